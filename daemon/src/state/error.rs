//! Why a state file is refused.

use std::path::PathBuf;

/// Why a state file is refused; the daemon then starts cold.
#[derive(Debug, thiserror::Error)]
pub enum StateError {
    /// The system does not give or take the file.
    #[error("{path}: {action} failed: {source}")]
    System {
        /// The file or directory.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The file does not begin as a state file does.
    #[error("{path}: not a state file of Dynocar")]
    NotAState {
        /// The file.
        path: PathBuf,
    },
    /// The file is of another schema.
    #[error("{path}: state schema {found}, expected {expected}")]
    Schema {
        /// The file.
        path: PathBuf,
        /// Its schema.
        found: String,
        /// The schema of this release.
        expected: u32,
    },
    /// The file is longer or shorter than it was written.
    #[error("{path}: torn: expected {expected} bytes after the header, found {found}")]
    Torn {
        /// The file.
        path: PathBuf,
        /// Bytes by the header.
        expected: usize,
        /// Bytes there are.
        found: usize,
    },
    /// The content is not what was written.
    #[error("{path}: corrupt: checksum {saved:016x} saved, {calculated:016x} calculated")]
    Corrupt {
        /// The file.
        path: PathBuf,
        /// Checksum in the header.
        saved: u64,
        /// Checksum of the content.
        calculated: u64,
    },
    /// The content is whole but cannot be understood.
    #[error("{path}: {message}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What the reader says.
        message: String,
    },
    /// The file is of another train, wheel set or model.
    #[error("{path}: foreign: its {what} is {saved}, expected {ours}")]
    Foreign {
        /// The file.
        path: PathBuf,
        /// Which part of the key differs.
        what: &'static str,
        /// The file's.
        saved: String,
        /// The configuration's.
        ours: String,
    },
}
