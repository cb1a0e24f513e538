//! Setting and getting variables by their value references.

#![allow(non_snake_case, reason = "the names are the standard's")]

use std::ffi::c_int;

use super::instance::{Boolean, Component, FmiString, Status, call, text};
use crate::error::ModelError;
use crate::model::Model;

/// Gets a row of variables.
///
/// # Safety
///
/// See [the module](super#safety).
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
/// See [the module](super#safety).
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
        /// See [the module](super#safety).
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
/// See [the module](super#safety).
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
