//! Refusals of a value by a configuration, with reasons.

use std::path::{Path, PathBuf};

use dynocar_dataset::FileProblem;

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file's text cannot be read.
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
        /// Message of the reader, with the line.
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

/// Names the configuration's file in every refusal.
pub(super) struct Checker<'a> {
    pub path: &'a Path,
}

impl Checker<'_> {
    /// Returns the folder to which file names in the configuration are relative.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new("."))
    }

    pub fn refuse<T>(
        &self,
        key: impl Into<String>,
        value: impl ToString,
        allowed: impl Into<String>,
    ) -> Result<T, ConfigError> {
        Err(ConfigError::OutOfRange {
            path: self.path.into(),
            key: key.into(),
            value: value.to_string(),
            allowed: allowed.into(),
        })
    }

    pub fn range(&self, key: &str, value: u64, low: u64, high: u64) -> Result<u64, ConfigError> {
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        self.refuse(key, value, format!("a whole number from {low} to {high}"))
    }
}
