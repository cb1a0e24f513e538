//! The contract between a train controller and the Dynocar daemon, and nothing else.
//!
//! The crate knows bytes: which fields cross the shared memory, in which units, at which offsets, under which service
//! names. It allocates nothing, depends on no other crate, and holds no estimator, so that it may be linked into a
//! controller.
//!
//! # Layout
//!
//! - [`layout`]: how a type describes its own bytes, and the hash both peers compare
//! - [`sample`]: the sample of each control cycle, [`TrainSample`]
//! - [`mod@vocabulary`]: pipelines, parameters, statuses, reasons, effects: the numbers on the wire
//! - [`snapshot`]: the daemon's answer, [`ParameterSnapshot`]
//! - [`resistance`]: resistance at a speed, with its standard deviation, from a snapshot
//! - [`adhesion`]: adhesion laws over speed
//! - [`stopping`]: braking distance and time from a speed, with a bound
//! - [`quantile`]: quantiles of the normal distribution
//! - [`schema`]: meaning and unit of each field of sample and snapshot, and when it is missing
//! - [`services`]: names, prefix and schema version of the channels; which pipeline threads want to be woken

pub mod adhesion;
pub mod layout;
pub mod quantile;
pub mod resistance;
pub mod sample;
pub mod schema;
pub mod services;
pub mod snapshot;
pub mod stopping;
pub mod vocabulary;

pub use adhesion::{RailCondition, Uncertain};
pub use quantile::HALF_95;
pub use resistance::ResistanceEstimate;
pub use sample::{SampleField, TrainId, TrainSample};
pub use services::{SCHEMA_MAJOR, SleeperState};
pub use snapshot::ParameterSnapshot;
pub use stopping::{
    BrakeResponse, EffortPoint, RailAdhesion, Stop, StoppingError, StoppingEstimate,
};
pub use vocabulary::{
    Manoeuvre, MassSource, Parameter, PipelineKind, Quantity, Reason, RejectionReason, Status,
    UseState,
};
