//! The life of an instance, from instantiation over its steps to its end.
//!
//! Some functions of the standard that `modelDescription.xml` does not promise exist nevertheless, so that every
//! simulator can load the library; they answer with an error in words.

#![allow(non_snake_case, reason = "the names are the standard's")]

use std::ffi::{c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::instance::{
    Boolean, CO_SIMULATION, CallbackFunctions, Component, FmiString, Instance, Log, Status, call,
    take_back, text,
};
use crate::description::INTERFACES;
use crate::error::ModelError;
use crate::model::Model;

/// The platform of the types.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

/// The version of the standard.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

/// Makes an instance; NULL, with words to the logger, when it is asked for another FMU than this one.
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2Instantiate(
    name: FmiString,
    kind: c_int,
    guid: FmiString,
    resources: FmiString,
    callbacks: *const CallbackFunctions,
    _visible: Boolean,
    _logging_on: Boolean,
) -> Component {
    if callbacks.is_null() {
        return std::ptr::null_mut();
    }
    // SAFETY: promised by the caller.
    let (callbacks, name, guid, resources) =
        unsafe { (*callbacks, text(name), text(guid), text(resources)) };
    let make = || {
        let log = Log::new(name.unwrap_or(c"dynocar"), &callbacks);
        let guid = guid.unwrap_or_default().to_string_lossy();
        if kind != CO_SIMULATION {
            log.report("this FMU is for co-simulation only");
            None
        } else if let Some(interface) = INTERFACES.into_iter().find(|it| it.guid == guid) {
            let resources = resources.unwrap_or_default().to_string_lossy().into_owned();
            Some(Instance::hand_out(Model::new(interface, resources), log))
        } else {
            let [one, other] = INTERFACES.map(|it| it.guid);
            log.report(&format!(
                "modelDescription.xml is of {guid}, the library of {one} and {other}"
            ));
            None
        }
    };
    match catch_unwind(AssertUnwindSafe(make)) {
        Ok(component) => component.unwrap_or(std::ptr::null_mut()),
        Err(payload) => {
            std::mem::forget(payload);
            std::ptr::null_mut()
        }
    }
}

/// Frees an instance.
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2FreeInstance(component: Component) {
    // SAFETY: promised by the caller.
    unsafe { take_back(component) }
}

/// Exports the functions that a simulator calls with an instance, but for those of values.
macro_rules! calls {
    ($( $(#[$meta:meta])* $name:ident($($argument:ident: $type:ty),*), $work:expr; )*) => { $(
        $(#[$meta])*
        ///
        /// # Safety
        ///
        /// See [the module](super#safety).
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(component: Component $(, $argument: $type)*) -> Status {
            // SAFETY: promised by the caller.
            unsafe { call(component, $work) }
        }
    )* };
}

calls! {
    /// Accepted without effect: errors are always logged, and there is nothing else to log.
    fmi2SetDebugLogging(_logging_on: Boolean, _count: usize, _categories: *const FmiString), |_| Ok(());
    /// Takes note of when an experiment begins; tolerance and stop matter to no model.
    fmi2SetupExperiment(
        _tolerance_defined: Boolean, _tolerance: f64, start_time_s: f64,
        _stop_time_defined: Boolean, _stop_time_s: f64
    ), |model| model.set_up_experiment(start_time_s);
    /// Reads the files of train and line.
    fmi2EnterInitializationMode(), Model::enter_initialization;
    /// Ends the initialization.
    fmi2ExitInitializationMode(), Model::exit_initialization;
    /// Takes the inputs as they are at the beginning of the step.
    fmi2DoStep(
        time_s: f64, step_s: f64, _no_set_state_prior: Boolean
    ), |model| model.step(time_s, step_s);
    /// Ends the simulation.
    fmi2Terminate(), Model::terminate;
    /// Forgets everything since the instance was made.
    fmi2Reset(), |model| {
        model.reset();
        Ok(())
    };
}

macro_rules! unsupported {
    ($($name:ident($($argument:ident: $type:ty),*);)*) => { $(
        /// Always an error.
        ///
        /// # Safety
        ///
        /// See [the module](super#safety).
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(component: Component $(, $argument: $type)*) -> Status {
            // SAFETY: promised by the caller.
            unsafe { call(component, |_| Err(ModelError::NotSupported(stringify!($name)))) }
        }
    )* };
}

unsupported! {
    fmi2GetFMUstate(_state: *mut *mut c_void);
    fmi2SetFMUstate(_state: *mut c_void);
    fmi2FreeFMUstate(_state: *mut *mut c_void);
    fmi2SerializedFMUstateSize(_state: *mut c_void, _size: *mut usize);
    fmi2SerializeFMUstate(_state: *mut c_void, _bytes: *mut c_char, _size: usize);
    fmi2DeSerializeFMUstate(_bytes: *const c_char, _size: usize, _state: *mut *mut c_void);
    fmi2GetDirectionalDerivative(
        _unknowns: *const u32, _unknown_count: usize, _knowns: *const u32, _known_count: usize,
        _known: *const f64, _unknown: *mut f64
    );
    fmi2GetRealOutputDerivatives(
        _references: *const u32, _count: usize, _orders: *const c_int, _values: *mut f64
    );
    fmi2CancelStep();
    fmi2GetStatus(_kind: c_int, _value: *mut c_int);
    fmi2GetRealStatus(_kind: c_int, _value: *mut f64);
    fmi2GetIntegerStatus(_kind: c_int, _value: *mut c_int);
    fmi2GetBooleanStatus(_kind: c_int, _value: *mut c_int);
    fmi2GetStringStatus(_kind: c_int, _value: *mut FmiString);
}
