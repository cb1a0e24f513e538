//! Errors of the store of models.

use std::path::PathBuf;

use dynocar_dataset::{DatasetError, FileProblem};
use dynocar_shared::TrainId;

use super::text::ModelHash;
use crate::storage::StorageError;

/// Why the store of models does not give or take something.
#[derive(Debug, thiserror::Error)]
pub enum ModelsError {
    /// The system does not write.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// A file or folder of the store cannot be read.
    #[error("{path}: {problem}")]
    Unreadable {
        /// The file or folder.
        path: PathBuf,
        /// Why not.
        problem: FileProblem,
    },
    /// A file of the store is not of the form that the store writes.
    #[error("{path}: no record of a store of models: {message}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Message of the reader.
        message: String,
    },
    /// The files of a model are no longer those that were put there.
    #[error(
        "{path}: changed after it was put into the store: its files have the hash {found}; it is \
         not used"
    )]
    Changed {
        /// The model's folder.
        path: PathBuf,
        /// The hash of the present contents.
        found: ModelHash,
    },
    /// There is no such model.
    #[error("the store holds no model {hash} of train {train}; `dynocar models list` names them")]
    NoModel {
        /// The model.
        hash: ModelHash,
        /// The train.
        train: TrainId,
    },
    /// The model is in force already.
    #[error("model {hash} is in force already")]
    InForce {
        /// The model.
        hash: ModelHash,
    },
    /// Nothing was adopted that could be taken back.
    #[error("train {train}: what the configuration declares is in force: nothing to roll back")]
    NothingAdopted {
        /// The train.
        train: TrainId,
    },
    /// A decision is somebody's.
    #[error("a decision needs the name of who decides, found none")]
    NoName,
    /// A model's file is wrong.
    #[error(transparent)]
    Model(#[from] DatasetError),
}
