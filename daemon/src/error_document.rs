//! A failure for machines: for whoever asked for a result as JSON, and for a program of ours that called another.

use serde::{Deserialize, Serialize};

/// A failure for machines.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErrorAnswer {
    /// As on standard error.
    pub message: String,
    /// The file where it is, when one is wrong.
    pub file: Option<String>,
    /// Line in the file, from 1.
    pub line: Option<usize>,
    /// Exit status of the command.
    pub exit_status: u8,
}

/// What stands in the place of a result.
#[derive(Serialize, Deserialize)]
pub struct ErrorDocument {
    /// Why there is none.
    pub error: ErrorAnswer,
}
