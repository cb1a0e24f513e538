//! Scenarios, simulator and process harness for the tests of Dynocar.
//!
//! # Layout
//!
//! - [`browser`]: a headless browser that reports the state of a page
//! - [`chance`]: random numbers of simulators and measurements
//! - [`documents`]: the pages, their links and the commands that they show
//! - [`fuzz`]: mutations of a corpus, given to every reader of foreign bytes
//! - [`golden`]: estimates of every estimator from the demo's recorded runs, bit for bit; default estimators, with
//!   cheaper windows of expectation maximisation
//! - [`power_cut`]: a disk that loses unsynced writes
//! - [`process`]: real processes with a run-time directory of their own, cleaned up on drop
//! - [`sensor_failures`]: how sensors and channels fail
//! - [`simulator`]: recorded runs of random trains with known, undeclared effects
//! - [`soak`]: seeded faults, for seconds in the tests and for hours by `dynocar-soak`
//! - [`sources`]: the project's own sources
//! - [`tram`]: a tram from stop to stop

pub mod browser;
pub mod chance;
pub mod documents;
pub mod fuzz;
pub mod golden;
pub mod power_cut;
pub mod process;
pub mod sensor_failures;
pub mod simulator;
pub mod soak;
pub mod sources;
pub mod tram;
