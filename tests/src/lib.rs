//! Scenarios, simulator and process harness for the tests of Dynocar.
//!
//! - [`process`]: real processes with a run-time directory of their own, cleaned up on drop

pub mod process;
