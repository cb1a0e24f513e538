//! Scenarios, simulator and process harness for the tests of Dynocar.
//!
//! # Layout
//!
//! - [`golden`]: what every estimator makes of the recorded runs, bit for bit
//! - [`process`]: real processes with a run-time directory of their own, cleaned up on drop
//! - [`simulator`]: recorded runs of random trains with known, undeclared effects
//! - [`soak`]: seeded faults, for seconds in the tests and for hours by `dynocar-soak`

pub mod golden;
pub mod process;
pub mod simulator;
pub mod soak;
