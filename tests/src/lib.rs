//! Scenarios, simulator and process harness for the tests of Dynocar.
//!
//! # Layout
//!
//! - [`simulator`]: recorded runs of random trains with known, undeclared effects

pub mod simulator;
