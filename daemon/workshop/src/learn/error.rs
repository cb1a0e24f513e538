//! Why learning does not go on.

use std::path::PathBuf;

use crate::convert::ToDatasetError;
use dynocar::models::ModelsError;
use dynocar::state::StateError;
use dynocar::storage::StorageError;

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
