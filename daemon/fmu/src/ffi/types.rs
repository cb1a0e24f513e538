//! The types of the FMI standard 2.0, platform `default`.

use std::ffi::{c_char, c_int, c_void};

/// `fmi2Component`: an instance, see [`super::instance::Instance`].
pub type Component = *mut c_void;
/// `fmi2String`: UTF-8, ends with NUL.
pub type Text = *const c_char;
/// `fmi2Boolean`: 0 is false.
pub type Boolean = c_int;

/// `fmi2Status`: how a call went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum Status {
    /// All well.
    Ok = 0,
    /// The call was refused; the logger was given the reason.
    Error = 3,
}

/// `fmi2CoSimulation` of `fmi2Type`.
pub const CO_SIMULATION: c_int = 1;

/// `fmi2CallbackLogger`: environment, name of the instance, status, category, format and what the
/// format asks for.
pub type Logger = unsafe extern "C" fn(*mut c_void, Text, c_int, Text, Text, ...);

/// `fmi2CallbackFunctions`: what the simulator lends an instance. Only the logger is used.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct CallbackFunctions {
    /// Takes messages.
    pub logger: Option<Logger>,
    /// Gives memory.
    pub allocate_memory: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    /// Takes memory back.
    pub free_memory: Option<unsafe extern "C" fn(*mut c_void)>,
    /// Hears of the end of a step that goes on in the background.
    pub step_finished: Option<unsafe extern "C" fn(*mut c_void, c_int)>,
    /// Handed to each of them.
    pub component_environment: *mut c_void,
}
