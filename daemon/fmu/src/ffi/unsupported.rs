//! Functions of the standard that `modelDescription.xml` does not promise: there, so that every
//! simulator can load the library, and answered with an error in words.

#![allow(non_snake_case, reason = "the names are the standard's")]

use std::ffi::{c_char, c_int, c_void};

use super::instance::call;
use super::types::{Component, Status, Text};
use crate::error::ModelError;

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
    fmi2GetStringStatus(_kind: c_int, _value: *mut Text);
}
