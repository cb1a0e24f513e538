//! How a configuration refuses a value.

use std::path::Path;

use super::ConfigError;

/// Names the configuration's file in every refusal.
pub(super) struct Checker<'a> {
    pub path: &'a Path,
}

impl Checker<'_> {
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
