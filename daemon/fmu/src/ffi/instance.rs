//! The FMI standard 2.0's types, the target of an `fmi2Component`, and the barrier that panics do not pass.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::error::ModelError;
use crate::model::Model;

/// A model with the simulator's logger.
pub struct Instance {
    model: Model,
    log: Log,
}

impl Instance {
    /// Returns an instance on the heap, for the simulator to hold.
    pub(super) fn hand_out(model: Model, log: Log) -> Component {
        Box::into_raw(Box::new(Instance { model, log })).cast()
    }
}

/// Where messages of an instance go.
pub(super) struct Log {
    name: CString,
    logger: Option<Logger>,
    environment: *mut c_void,
}

impl Log {
    /// Returns the log of an instance by name and callbacks.
    pub(super) fn new(name: &CStr, callbacks: &CallbackFunctions) -> Self {
        let CallbackFunctions { logger, component_environment: environment, .. } = *callbacks;
        Log { name: name.into(), logger, environment }
    }

    /// Reports to the simulator why a call was refused.
    pub(super) fn report(&self, words: &str) {
        let Some(logger) = self.logger else { return };
        // The message is a format, where these signs have a meaning of their own.
        let words = words.replace('%', "%%").replace('#', "##").replace('\0', " ");
        let Ok(words) = CString::new(words) else { return };
        let category = c"logStatusError";
        // SAFETY: the simulator lends the logger and its environment for as long as the instance
        // lives; all texts end with NUL and outlive the call; the format asks for no argument.
        unsafe {
            logger(
                self.environment,
                self.name.as_ptr(),
                Status::Error as i32,
                category.as_ptr(),
                words.as_ptr(),
            );
        }
    }
}

const FAULT: &str = "a fault inside the FMU; its words went to standard error";

/// Runs the body of an exported function on the model: a refusal is reported and becomes an error, and
/// so does a panic, after which only a reset helps.
///
/// # Safety
///
/// See [the module](super#safety).
pub(super) unsafe fn call(
    component: Component,
    work: impl FnOnce(&mut Model) -> Result<(), ModelError>,
) -> Status {
    if component.is_null() {
        return Status::Error;
    }
    // SAFETY: a component that is not NULL points to an instance that this thread alone is in.
    let Instance { model, log } = unsafe { &mut *component.cast::<Instance>() };
    match catch_unwind(AssertUnwindSafe(|| work(model))) {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(refusal)) => {
            log.report(&refusal.to_string());
            Status::Error
        }
        Err(payload) => {
            // Dropping a foreign payload may panic once more; leaking it cannot.
            std::mem::forget(payload);
            model.break_off();
            log.report(FAULT);
            Status::Error
        }
    }
}

/// Takes an instance back and drops it; NULL is gone already.
///
/// # Safety
///
/// See [the module](super#safety).
pub(super) unsafe fn take_back(component: Component) {
    if component.is_null() {
        return;
    }
    // SAFETY: the pointer came from `hand_out`, and the simulator gives it up.
    let instance = unsafe { Box::from_raw(component.cast::<Instance>()) };
    if let Err(payload) = catch_unwind(AssertUnwindSafe(|| drop(instance))) {
        std::mem::forget(payload);
    }
}

/// Returns the text behind a pointer, `None` for NULL.
///
/// # Safety
///
/// See [the module](super#safety).
pub(super) unsafe fn text<'a>(place: FmiString) -> Option<&'a CStr> {
    // SAFETY: a text that is not NULL ends with a NUL byte.
    (!place.is_null()).then(|| unsafe { CStr::from_ptr(place) })
}

/// `fmi2Component`: an instance, see [`Instance`].
pub type Component = *mut c_void;
/// `fmi2String`: UTF-8, ends with NUL.
pub type FmiString = *const c_char;
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

/// `fmi2CallbackLogger`: environment, name of the instance, status, category, format and the arguments of the format.
pub type Logger = unsafe extern "C" fn(*mut c_void, FmiString, c_int, FmiString, FmiString, ...);

/// `fmi2CallbackFunctions`: the functions that the simulator lends an instance. Only the logger is used.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimators::ESTIMATORS;

    #[test]
    fn a_panic_becomes_an_error_after_which_only_a_reset_helps() {
        let callbacks = CallbackFunctions {
            logger: None,
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: std::ptr::null_mut(),
        };
        let component =
            Instance::hand_out(Model::new(&ESTIMATORS, "".into()), Log::new(c"", &callbacks));
        let run = |work: fn(&mut Model) -> Result<(), ModelError>| {
            // SAFETY: the component lives until the end of the test, in this thread.
            unsafe { call(component, work) }
        };
        assert_eq!(run(|_| panic!("on purpose")), Status::Error);
        assert_eq!(run(|model| model.set_up_experiment(0.0)), Status::Error);
        assert_eq!(run(|model| model.set_real(3, 1.0)), Status::Error);
        assert_eq!(
            run(|model| {
                model.reset();
                Ok(())
            }),
            Status::Ok
        );
        assert_eq!(run(|model| model.set_up_experiment(0.0)), Status::Ok);
        // SAFETY: it is not used any more.
        unsafe { take_back(component) };
    }
}
