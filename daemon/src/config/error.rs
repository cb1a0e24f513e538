//! Why a configuration is refused.

use std::path::PathBuf;

use dynocar_dataset::FileProblem;

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file's text cannot be had.
    #[error("{path}: {problem}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why not.
        problem: FileProblem,
    },
    /// The file is no TOML, or has a key or type that is not expected.
    #[error("{path}: {message}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What the reader says, with the line.
        message: String,
    },
    /// A value lies outside its range.
    #[error("{path}: {key} = {value}: expected {allowed}")]
    OutOfRange {
        /// The file.
        path: PathBuf,
        /// The key, with its table.
        key: String,
        /// The value it was given.
        value: String,
        /// The allowed range, in words.
        allowed: String,
    },
    /// A train or track file is wrong; the message names it.
    #[error(transparent)]
    Model(#[from] crate::dataset::LoadError),
}
