//! The functions that a simulator calls, by the FMI standard 2.0 for co-simulation.
//!
//! Thin on purpose: each function checks its pointers and calls the [`Model`] behind the instance. A
//! refusal is reported to the simulator's logger in words and answered by [`Status::Error`]; no panic crosses the
//! boundary.
//!
//! # Layout
//!
//! - [`instance`]: the standard's types, the target of an `fmi2Component`, and the barrier that panics do not pass
//!
//! The functions themselves follow here: the life of an instance, from instantiation over its steps to its end; then
//! setting and getting variables by their value references. Some functions of the standard that `modelDescription.xml`
//! does not promise exist nevertheless, so that every simulator can load the library; they answer with an error in
//! words.
//!
//! # Safety
//!
//! All functions here have these conditions, set by the standard, and no others:
//!
//! - a component is NULL or comes from [`fmi2Instantiate`] and has not been freed, and no
//!   other thread is in a call with it;
//! - an array is NULL or holds as many elements as its count says, aligned, that nobody else
//!   touches during the call;
//! - a text is NULL or ends with a NUL byte;
//! - the callbacks may be called as long as the component lives.

#![allow(non_snake_case, reason = "the names are the standard's")]

pub mod instance;

use std::ffi::{c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};

use self::instance::{
    Boolean, CO_SIMULATION, CallbackFunctions, Component, FmiString, Instance, Log, call,
    take_back, text,
};
use crate::description::INTERFACES;
use crate::error::ModelError;
use crate::model::Model;

pub use self::instance::Status;

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
/// See [the module](self#safety).
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
/// See [the module](self#safety).
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
        /// See [the module](self#safety).
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
        /// See [the module](self#safety).
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

/// Gets a row of variables.
///
/// # Safety
///
/// See [the module](self#safety).
unsafe fn get<T>(
    component: Component,
    (references, count): (*const u32, usize),
    values: *mut T,
    one: impl Fn(&Model, u32) -> Result<T, ModelError>,
) -> Status {
    let all = |model: &mut Model| {
        require(references, count, "the array of value references")?;
        require(values, count, "the array of values")?;
        for index in 0..count {
            // SAFETY: both arrays hold `count` elements, of which this is one.
            unsafe { values.add(index).write(one(model, references.add(index).read())?) };
        }
        Ok(())
    };
    // SAFETY: promised by the caller.
    unsafe { call(component, all) }
}

/// Sets a row of variables; those before one that is refused are set.
///
/// # Safety
///
/// See [the module](self#safety).
unsafe fn set<T: Copy>(
    component: Component,
    (references, count): (*const u32, usize),
    values: *const T,
    one: impl Fn(&mut Model, u32, T) -> Result<(), ModelError>,
) -> Status {
    let all = |model: &mut Model| {
        require(references, count, "the array of value references")?;
        require(values, count, "the array of values")?;
        for index in 0..count {
            // SAFETY: both arrays hold `count` elements, of which this is one.
            let (reference, value) =
                unsafe { (references.add(index).read(), values.add(index).read()) };
            one(model, reference, value)?;
        }
        Ok(())
    };
    // SAFETY: promised by the caller.
    unsafe { call(component, all) }
}

/// Refuses a NULL in the place of an array, unless it is empty.
fn require<T>(array: *const T, count: usize, name: &'static str) -> Result<(), ModelError> {
    if count > 0 && array.is_null() { Err(ModelError::Null(name)) } else { Ok(()) }
}

/// Exports the functions that get or set a row of variables of one type.
macro_rules! rows {
    ($( $(#[$meta:meta])* $name:ident: $way:ident $array:ty, $one:expr; )*) => { $(
        $(#[$meta])*
        ///
        /// # Safety
        ///
        /// See [the module](self#safety).
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            component: Component,
            references: *const u32,
            count: usize,
            values: $array,
        ) -> Status {
            // SAFETY: promised by the caller.
            unsafe { $way(component, (references, count), values, $one) }
        }
    )* };
}

rows! {
    /// Gets numbers.
    fmi2GetReal: get *mut f64, Model::real;
    /// Gets whole numbers and members of enumerations.
    fmi2GetInteger: get *mut c_int, Model::integer;
    /// Gets truth values.
    fmi2GetBoolean: get *mut Boolean, |model, reference| Ok(model.boolean(reference)?.into());
    /// Gets texts, which are good until they are set, reset or freed.
    fmi2GetString: get *mut FmiString, |model, reference| Ok(model.string(reference)?.as_ptr());
    /// Sets measured inputs.
    fmi2SetReal: set *const f64, Model::set_real;
    /// Sets the run and the direction.
    fmi2SetInteger: set *const c_int, Model::set_integer;
    /// Sets truth values.
    fmi2SetBoolean: set *const Boolean, |model, reference, value| model.set_boolean(reference, value != 0);
    /// Sets the paths of files.
    fmi2SetString: set *const FmiString, set_text;
}

fn set_text(model: &mut Model, reference: u32, value: FmiString) -> Result<(), ModelError> {
    // SAFETY: a text of the caller's array, or NULL.
    let value = unsafe { text(value) };
    model.set_string(reference, value.ok_or(ModelError::Null("a text"))?)
}

/// Sets the slopes of inputs during the next step, where the model takes them.
///
/// # Safety
///
/// See [the module](self#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetRealInputDerivatives(
    component: Component,
    references: *const u32,
    count: usize,
    orders: *const c_int,
    values: *const f64,
) -> Status {
    let all = |model: &mut Model| {
        require(references, count, "the array of value references")?;
        require(orders, count, "the array of orders")?;
        require(values, count, "the array of values")?;
        for index in 0..count {
            // SAFETY: all arrays hold `count` elements, of which this is one.
            let (reference, order, value) = unsafe {
                (references.add(index).read(), orders.add(index).read(), values.add(index).read())
            };
            model.set_slope(reference, (order, value))?;
        }
        Ok(())
    };
    // SAFETY: promised by the caller.
    unsafe { call(component, all) }
}
