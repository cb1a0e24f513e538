//! How grown files begin, and why they cannot be written.

use dynocar::dataset::LoadError;
use dynocar::output::OutputError;

/// Why the grown files cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum UpdatedModelError {
    /// The dataset cannot be read.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A declared file is not there any more or is no TOML.
    #[error("{label}: expected a TOML file, got {problem}")]
    Declared {
        /// The file.
        label: String,
        /// What is wrong.
        problem: String,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// How a grown file begins.
pub const UPDATED_MARK: &str = "# Grown from ";
