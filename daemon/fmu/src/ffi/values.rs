//! Setting and getting variables by their value references.

#![allow(non_snake_case, reason = "the names are the standard's")]

use std::ffi::c_int;

use super::instance::{Boolean, Component, Status, Text, call, text};
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

/// Gets numbers.
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetReal(
    component: Component,
    references: *const u32,
    count: usize,
    values: *mut f64,
) -> Status {
    // SAFETY: promised by the caller.
    unsafe { get(component, (references, count), values, Model::real) }
}

/// Gets whole numbers and members of enumerations.
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetInteger(
    component: Component,
    references: *const u32,
    count: usize,
    values: *mut c_int,
) -> Status {
    // SAFETY: promised by the caller.
    unsafe { get(component, (references, count), values, Model::integer) }
}

/// Gets truth values.
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetBoolean(
    component: Component,
    references: *const u32,
    count: usize,
    values: *mut Boolean,
) -> Status {
    let one = |model: &Model, reference: u32| Ok(Boolean::from(model.boolean(reference)?));
    // SAFETY: promised by the caller.
    unsafe { get(component, (references, count), values, one) }
}

/// Gets texts, which are good until they are set, reset or freed.
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetString(
    component: Component,
    references: *const u32,
    count: usize,
    values: *mut Text,
) -> Status {
    let one = |model: &Model, reference: u32| Ok(model.string(reference)?.as_ptr());
    // SAFETY: promised by the caller.
    unsafe { get(component, (references, count), values, one) }
}

/// Sets measured inputs.
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetReal(
    component: Component,
    references: *const u32,
    count: usize,
    values: *const f64,
) -> Status {
    // SAFETY: promised by the caller.
    unsafe { set(component, (references, count), values, Model::set_real) }
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

/// Sets the run and the direction.
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetInteger(
    component: Component,
    references: *const u32,
    count: usize,
    values: *const c_int,
) -> Status {
    // SAFETY: promised by the caller.
    unsafe { set(component, (references, count), values, Model::set_integer) }
}

/// Sets truth values.
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetBoolean(
    component: Component,
    references: *const u32,
    count: usize,
    values: *const Boolean,
) -> Status {
    let one = |model: &mut Model, reference: u32, value: Boolean| {
        model.set_boolean(reference, value != 0)
    };
    // SAFETY: promised by the caller.
    unsafe { set(component, (references, count), values, one) }
}

/// Sets the paths of files.
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetString(
    component: Component,
    references: *const u32,
    count: usize,
    values: *const Text,
) -> Status {
    let one = |model: &mut Model, reference: u32, value: Text| {
        // SAFETY: promised by the caller.
        let value = unsafe { text(value) };
        model.set_string(reference, value.ok_or(ModelError::Null("a text"))?)
    };
    // SAFETY: promised by the caller.
    unsafe { set(component, (references, count), values, one) }
}
