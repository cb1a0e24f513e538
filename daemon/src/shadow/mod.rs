//! Models on trial in the shadow of the one in force, and the change from one to another.
//!
//! A thread of its own takes the samples of the trains once more, next to the pipeline threads, and lets the model in
//! force and its rivals predict them ([`dynocar_core::trial`]). Rivals are candidates of the store
//! ([`crate::models`]), the model that was in force before, and the one that was last taken out of force by a rollback
//! to the model before it. Each rival has its own pipelines and residual monitor, whose snapshots nobody else sees.
//! When the store's decisions put another model in force, its pipelines, warm by then, change places with those at
//! work while the train stands ([`crate::runtime::exchange`]). The pipeline threads and the controller never wait for
//! any of this.
//!
//! # Layout
//!
//! - [`in_force`]: which model a train has when the daemon starts
//! - [`rule`]: which models are on trial, when a rule adopts or takes back, and which bounds no model may leave
//! - [`train`]: one train's trials, and its change of models
//! - [`record`]: measurements of the trials: a file that outlives the daemon, and figures for the metrics
//! - [`thread`]: the thread

pub mod in_force;
pub mod record;
pub mod rule;
pub mod thread;
pub mod train;

pub use record::{Board, Pinned, TrialFigures};
pub use train::ShadowTrain;
