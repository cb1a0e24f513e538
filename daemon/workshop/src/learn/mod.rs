//! Learning from recorded runs: a companion of the daemon that collects runs, explains them against the model in force,
//! and puts its findings into the store of models. It is never in the control cycle.
//!
//! A [`Learner`] works in rounds; clock and folders come from outside, and a round neither sleeps nor waits. The
//! process around it (`dynocar learn`) starts a round at a new suspicion, at a time of each day, or once.
//!
//! # Layout, in the order of the work
//!
//! - [`memory`]: memory from round to round; recordings, each unpacked once
//! - [`available_runs`]: the available runs
//! - [`pool`]: the runs that are explained together, with the model in force as their train and line
//! - [`conclusion`]: findings of an explanation, a candidate, events or an open question, as entries for the store
//! - [`learner`]: a round of learning
//! - [`page`]: the history as a page, with the errors that the daemon's trials measured

use std::path::PathBuf;

pub use conclusion::Explained;
use dynocar::models::ModelsError;
use dynocar::state::StateError;
use dynocar::storage::StorageError;
pub use learner::{Learner, LearnerRound, LearnerSettings, RoundOutcome, TrainRound};
pub use pool::Bounds;

use super::convert::ToDatasetError;

pub mod available_runs;
pub mod conclusion;
pub mod learner;
pub mod memory;
pub mod page;
pub mod pool;

/// Why learning does not go on.
#[derive(Debug, thiserror::Error)]
pub enum LearnError {
    /// The store does not give or take something.
    #[error(transparent)]
    Models(#[from] ModelsError),
    /// The runs cannot be had.
    #[error("{}: the runs cannot be read: {source}", path.display())]
    Runs {
        /// The file or folder.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// Another learner is at work.
    #[error("{}: another learner works on this store", path.display())]
    Taken {
        /// The lock.
        path: PathBuf,
    },
    /// A recording cannot be unpacked.
    #[error(transparent)]
    Unpack(#[from] ToDatasetError),
    /// The memory cannot be written.
    #[error(transparent)]
    Memory(#[from] StateError),
    /// A folder cannot be made.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// The report of a candidate cannot be made.
    #[error("the report cannot be made: {0}")]
    Report(String),
}
