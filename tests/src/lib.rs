//! Scenarios, simulator and process harness for the tests of Dynocar.
//!
//! # Layout
//!
//! - [`browser`]: a headless browser that says what a page did
//! - [`process`]: real processes with a run-time directory of their own, cleaned up on drop
//! - [`simulator`]: recorded runs of random trains with known, undeclared effects

pub mod browser;
pub mod process;
pub mod simulator;
