//! What is written, and what was understood of recordings.

use dynocar_analysis::dataset::DatasetDiagnostic;
use dynocar_analysis::dataset::guess::Guess;

/// Name of the daemon's configuration.
pub const DAEMON_FILE: &str = "daemon.toml";

/// What was understood of the recordings.
pub struct Described {
    /// Which column was taken for what.
    pub guess: Guess,
    /// The runs' files, as the dataset names them.
    pub files: Vec<String>,
    /// What cannot be true of the runs as they were understood, the worst first.
    pub diagnostics: Vec<DatasetDiagnostic>,
    /// `dataset.toml`.
    pub text: String,
}
