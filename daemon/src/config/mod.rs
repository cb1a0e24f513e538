//! The daemon's configuration: `daemon.toml`.
//!
//! Unknown keys are refused; a value outside its range is refused with key, value and range.
//! File names inside the configuration are relative to the configuration file.

mod apart;
mod check;
mod error;
mod parts;
mod quantities;
mod raw;
mod whole;

pub use apart::is_slow;
pub use error::ConfigError;
pub use parts::{
    IdleStrategy, LogFormat, ModelsConfig, PipelineConfig, ProcessConfig, StateConfig, ThreadConfig,
};
pub use quantities::Answers;
pub use whole::{DaemonConfig, TrainConfig};

use std::path::Path;

use crate::dataset::read_text;

impl DaemonConfig {
    /// Reads and checks a configuration and the train and track files it names.
    ///
    /// # Errors
    ///
    /// See [`ConfigError`]; every message names the file and the expected value.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let text = read_text(path)
            .map_err(|problem| ConfigError::Unreadable { path: path.into(), problem })?;
        DaemonConfig::from_text(path, &text)
    }

    /// Checks the text of a configuration, and the train and track files it names; `path` is the
    /// file it came from.
    ///
    /// # Errors
    ///
    /// See [`ConfigError`].
    pub fn from_text(path: &Path, text: &str) -> Result<Self, ConfigError> {
        check::check(path, text)
    }
}
