//! A simulator as an FMU meets it: it calls the standard's functions, and keeps the FMU's messages.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_int, c_void};

use dynocar_fmu::ffi::instance::{CO_SIMULATION, CallbackFunctions, Component, FmiString, Logger};
use dynocar_fmu::ffi::{
    Status, fmi2DoStep, fmi2EnterInitializationMode, fmi2ExitInitializationMode, fmi2FreeInstance,
    fmi2GetBoolean, fmi2GetInteger, fmi2GetReal, fmi2Instantiate, fmi2SetBoolean, fmi2SetInteger,
    fmi2SetReal, fmi2SetRealInputDerivatives, fmi2SetString, fmi2SetupExperiment,
};
use dynocar_fmu::{ESTIMATORS, Interface};

/// Messages of an FMU.
type Said = RefCell<Vec<String>>;

/// A logger for formats that ask for no argument.
type PlainLogger = unsafe extern "C" fn(*mut c_void, FmiString, c_int, FmiString, FmiString);

/// Stores a message; the FMU's formats ask for no argument.
unsafe extern "C" fn take_down(
    said: *mut c_void,
    _name: FmiString,
    _status: c_int,
    _category: FmiString,
    words: FmiString,
) {
    // SAFETY: the environment is the list of the instance that speaks, and words end with NUL.
    let (said, words) = unsafe { (&*said.cast::<Said>(), CStr::from_ptr(words)) };
    said.borrow_mut().push(words.to_str().unwrap().into());
}

/// The value reference of a name in a model.
pub fn reference_in(model: &Interface, name: &str) -> u32 {
    let place = model.variables.iter().position(|variable| variable.name == name);
    place.unwrap_or_else(|| panic!("no variable {name}")) as u32
}

/// The value reference of a name among the estimators'.
pub fn reference(name: &str) -> u32 {
    reference_in(&ESTIMATORS, name)
}

/// An instance, freed at the end.
pub struct Fmu {
    /// Component with which the functions are called.
    pub component: Component,
    said: Box<Said>,
}

impl Drop for Fmu {
    fn drop(&mut self) {
        // SAFETY: nobody uses the component any more.
        unsafe { fmi2FreeInstance(self.component) };
    }
}

impl Fmu {
    /// Asks for an instance; NULL where the FMU refuses.
    pub fn instantiate(kind: c_int, guid: &str, resources: &str) -> Fmu {
        let said = Box::<Said>::default();
        let callbacks = CallbackFunctions {
            // SAFETY: on the platforms of the project a call with no further arguments is the same.
            logger: Some(unsafe { std::mem::transmute::<PlainLogger, Logger>(take_down) }),
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: std::ptr::from_ref(&*said).cast_mut().cast(),
        };
        let (guid, resources) = (CString::new(guid).unwrap(), CString::new(resources).unwrap());
        let (name, (guid, place)) = (c"train 1".as_ptr(), (guid.as_ptr(), resources.as_ptr()));
        // SAFETY: texts and callbacks outlive the call, the list of messages the component.
        let component = unsafe { fmi2Instantiate(name, kind, guid, place, &callbacks, 0, 0) };
        Fmu { component, said }
    }

    /// Returns an instance of the estimators that were unpacked next to this folder of resources.
    pub fn new(resources: &str) -> Fmu {
        Fmu::from_model(&ESTIMATORS, resources)
    }

    /// An instance of a model.
    pub fn from_model(model: &Interface, resources: &str) -> Fmu {
        let fmu = Fmu::instantiate(CO_SIMULATION, model.guid, resources);
        assert!(!fmu.component.is_null(), "{}", fmu.said());
        fmu
    }

    /// Returns the messages since the last call.
    pub fn said(&self) -> String {
        self.said.take().join("\n")
    }

    /// From instantiation to the first step.
    pub fn initialize(&self) {
        // SAFETY: the component lives.
        let went = unsafe {
            [
                fmi2SetupExperiment(self.component, 0, 0.0, 0.0, 0, 0.0),
                fmi2EnterInitializationMode(self.component),
                fmi2ExitInitializationMode(self.component),
            ]
        };
        assert_eq!(went, [Status::Ok; 3], "{}", self.said());
    }

    /// From instantiation into an initialization that does not end, for these words.
    pub fn initialize_refused(&self, words: &str) {
        // SAFETY: the component lives.
        unsafe {
            assert_eq!(fmi2SetupExperiment(self.component, 0, 0.0, 0.0, 0, 0.0), Status::Ok);
            assert_eq!(fmi2EnterInitializationMode(self.component), Status::Ok, "{}", self.said());
        }
        assert_eq!(self.exit_initialization(), Status::Error);
        let said = self.said();
        assert!(said.contains(words), "{said:?} lacks {words:?}");
    }

    /// The end of the initialization.
    pub fn exit_initialization(&self) -> Status {
        // SAFETY: the component lives.
        unsafe { fmi2ExitInitializationMode(self.component) }
    }

    /// A step from a time.
    pub fn step(&self, time_s: f64) -> Status {
        self.step_for(time_s, 0.1)
    }

    /// A step of a length in s from a time.
    pub fn step_for(&self, time_s: f64, step_s: f64) -> Status {
        // SAFETY: the component lives.
        unsafe { fmi2DoStep(self.component, time_s, step_s, 1) }
    }

    /// A number.
    pub fn real(&self, reference: u32) -> Option<f64> {
        let mut value = 0.0;
        // SAFETY: the arrays hold one element each.
        let went = unsafe { fmi2GetReal(self.component, &reference, 1, &mut value) };
        (went == Status::Ok).then_some(value)
    }

    /// A truth value.
    pub fn boolean(&self, reference: u32) -> Option<bool> {
        let mut value = 0;
        // SAFETY: the arrays hold one element each.
        let went = unsafe { fmi2GetBoolean(self.component, &reference, 1, &mut value) };
        (went == Status::Ok).then_some(value != 0)
    }

    /// A whole number.
    pub fn integer(&self, reference: u32) -> Option<i32> {
        let mut value = 0;
        // SAFETY: the arrays hold one element each.
        let went = unsafe { fmi2GetInteger(self.component, &reference, 1, &mut value) };
        (went == Status::Ok).then_some(value)
    }

    /// Sets a number.
    pub fn set_real(&self, reference: u32, value: f64) -> Status {
        // SAFETY: the arrays hold one element each.
        unsafe { fmi2SetReal(self.component, &reference, 1, &value) }
    }

    /// Sets the slope of a number.
    pub fn set_slope(&self, reference: u32, order: c_int, value: f64) -> Status {
        // SAFETY: the arrays hold one element each.
        unsafe { fmi2SetRealInputDerivatives(self.component, &reference, 1, &order, &value) }
    }

    /// Sets a whole number.
    pub fn set_integer(&self, reference: u32, value: i32) -> Status {
        // SAFETY: the arrays hold one element each.
        unsafe { fmi2SetInteger(self.component, &reference, 1, &value) }
    }

    /// Sets a truth value.
    pub fn set_boolean(&self, reference: u32, value: c_int) -> Status {
        // SAFETY: the arrays hold one element each.
        unsafe { fmi2SetBoolean(self.component, &reference, 1, &value) }
    }

    /// Sets a text.
    pub fn set_string(&self, reference: u32, value: &CStr) -> Status {
        // SAFETY: the arrays hold one element each, and the text ends with NUL.
        unsafe { fmi2SetString(self.component, &reference, 1, &value.as_ptr()) }
    }
}
