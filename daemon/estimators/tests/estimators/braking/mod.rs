//! The braking pipelines from the controller's samples to snapshots.

mod adhesion;
mod brake;
mod input;
pub mod simulation;
