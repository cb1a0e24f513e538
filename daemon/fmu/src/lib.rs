//! The daemon's own estimators as a Functional Mock-up Unit for co-simulation (FMI 2.0), so that
//! Simulink, OpenModelica or Dymola take them into a model.
//!
//! The estimators run in the simulator's process, without shared memory, on one sample for each
//! step, and give the bits that `dynocar identify` gives for the same samples.
//!
//! # Layout
//!
//! - [`variables`]: every variable of the FMU, in one table
//! - [`units`]: their units
//! - [`description`]: the table as `modelDescription.xml` and as a page for people
//! - [`location`]: where the FMU was unpacked
//! - [`error`]: why a call is refused
//! - [`files`]: the files of train and line, and the estimators for them
//! - [`model`]: what stands behind an instance: a sample, the estimators, the order of calls
//! - [`ffi`]: the functions that a simulator calls

pub mod description;
pub mod error;
pub mod ffi;
pub mod files;
pub mod location;
pub mod model;
pub mod units;
pub mod variables;

pub use description::{documentation, model_description};
pub use model::Model;
pub use variables::{GUID, MISSING, VARIABLES};

/// Name of the shared library inside the FMU, and prefix of its functions in the standard's sense.
pub const MODEL_IDENTIFIER: &str = "dynocar";
