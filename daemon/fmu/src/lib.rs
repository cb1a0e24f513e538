//! The daemon's own estimators, and the train that they describe, as Functional Mock-up Units for co-simulation (FMI
//! 2.0), which Simulink, OpenModelica or Dymola can include in a model.
//!
//! The estimators run in the simulator's process, without shared memory, on one sample for each step, and give the bits
//! that `dynocar identify` gives for the same samples. The train takes forces and gives its speed by the law by which
//! `dynocar explain` predicts. One library holds both models; the GUID decides which of the two an instance is.
//!
//! # Layout
//!
//! - [`variables`]: kinds of variables, and their units
//! - [`estimators`], [`plant`]: the two models, each with its table of variables
//! - [`description`]: both of them, as `modelDescription.xml` and as pages for people
//! - [`error`]: why a call is refused
//! - [`files`]: inputs during a step; where the FMU was unpacked, the files of train and line, and the models for them
//! - [`model`]: the model behind an instance: inputs, one of the models, the order of calls
//! - [`ffi`]: the functions that a simulator calls
//!
//! # Examples
//!
//! ```
//! let described = dynocar_fmu::model_description(&dynocar_fmu::PLANT, dynocar_fmu::STEP_DEFAULT_S);
//! assert!(described.contains("fmiVersion=\"2.0\""));
//! ```

pub mod description;
pub mod error;
pub mod estimators;
pub mod ffi;
pub mod files;
pub mod model;
pub mod plant;
pub mod variables;

pub use crate::description::INTERFACES;
pub use description::{STEP_DEFAULT_S, documentation, model_description};
pub use estimators::ESTIMATORS;
pub use model::Model;
pub use plant::{PLANT, STEP_MAX_S};
pub use variables::{Interface, MISSING};
