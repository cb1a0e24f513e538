//! The functions that a simulator calls, by the FMI standard 2.0 for co-simulation.
//!
//! Thin on purpose: each function checks its pointers and calls the [`Model`](crate::Model) behind the instance. A
//! refusal is reported to the simulator's logger in words and answered by [`Status::Error`]; no panic crosses the
//! boundary.
//!
//! # Layout
//!
//! - [`instance`]: the standard's types, the target of an `fmi2Component`, and the barrier that panics do not pass
//! - [`life`]: from instantiation to the end, the steps between, and functions that the description does not promise
//! - [`values`]: setting and getting variables
//!
//! # Safety
//!
//! All functions here have these conditions, set by the standard, and no others:
//!
//! - a component is NULL or comes from [`life::fmi2Instantiate`] and has not been freed, and no
//!   other thread is in a call with it;
//! - an array is NULL or holds as many elements as its count says, aligned, that nobody else
//!   touches during the call;
//! - a text is NULL or ends with a NUL byte;
//! - the callbacks may be called as long as the component lives.

pub mod instance;
pub mod life;
pub mod values;

pub use instance::Status;
