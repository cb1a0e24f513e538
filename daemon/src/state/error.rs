//! Reasons why a state file is refused.

use std::io;
use std::path::{Path, PathBuf};

/// Why a state file is refused; the daemon then starts cold.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {problem}")]
pub struct StateError {
    /// The file or directory.
    pub path: PathBuf,
    /// Problem of the file.
    pub problem: StateProblem,
}

/// Problem of a state file.
#[derive(Debug, thiserror::Error)]
pub enum StateProblem {
    /// The system does not give or take the file.
    #[error("{action} failed: {source}")]
    System {
        /// Attempted action.
        action: &'static str,
        /// The system's answer.
        source: io::Error,
    },
    /// The file does not begin as a state file does.
    #[error("not a state file of Dynocar")]
    NotAState,
    /// The file is of another schema.
    #[error("state schema {found}, expected {expected}")]
    Schema {
        /// Its schema.
        found: String,
        /// The schema of this release.
        expected: u32,
    },
    /// The file is longer or shorter than it was written.
    #[error("torn: expected {expected} bytes after the header, found {found}")]
    Torn {
        /// Bytes by the header.
        expected: usize,
        /// Bytes there are.
        found: usize,
    },
    /// The content differs from the content that was written.
    #[error("corrupt: checksum {saved:016x} saved, {calculated:016x} calculated")]
    Corrupt {
        /// Checksum in the header.
        saved: u64,
        /// Checksum of the content.
        calculated: u64,
    },
    /// The content is whole but cannot be understood, or not be written.
    #[error("{0}")]
    Malformed(String),
    /// The file is of another train, wheel set or model.
    #[error("foreign: its {what} is {saved}, expected {ours}")]
    Foreign {
        /// Which part of the key differs.
        what: &'static str,
        /// The file's.
        saved: String,
        /// The configuration's.
        ours: String,
    },
}

impl StateProblem {
    /// Of this file or directory.
    pub fn at(self, path: &Path) -> StateError {
        StateError { path: path.into(), problem: self }
    }
}
