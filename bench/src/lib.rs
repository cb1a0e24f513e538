//! The measurements behind every figure that Dynocar's documents state.
//!
//! - [`papers`]: accuracy of every estimator over seeded runs, beside the statistical bound

pub mod papers;
