//! Ranges of settings.

/// A setting outside its allowed range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key} = {value}: expected {allowed}")]
pub struct SettingError {
    /// The setting's name.
    pub key: &'static str,
    /// The value it was given.
    pub value: f64,
    /// The allowed range, in words.
    pub allowed: &'static str,
}

/// Refuses a setting unless `is_allowed`.
///
/// # Errors
///
/// Names key, value and range.
pub fn require(
    is_allowed: bool,
    key: &'static str,
    value: f64,
    allowed: &'static str,
) -> Result<(), SettingError> {
    if is_allowed { Ok(()) } else { Err(SettingError { key, value, allowed }) }
}
