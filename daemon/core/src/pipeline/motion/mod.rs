//! What every estimator takes from the samples of a moving train.
//!
//! - [`jump_variance`], [`kink_variance`]: what a trapezoid over a step misses
//! - [`Rounding`]: the steps that a speed is told in

mod missed;
mod rounding;

pub use missed::{jump_variance, kink_variance};
pub use rounding::Rounding;
