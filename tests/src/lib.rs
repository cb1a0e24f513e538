//! Scenarios, simulator and process harness for the tests of Dynocar.
//!
//! # Layout
//!
//! - [`simulator`]: recorded runs of random trains with known, undeclared effects
//! - [`process`]: real processes with a run-time directory of their own, cleaned up on drop

pub mod process;
pub mod simulator;
