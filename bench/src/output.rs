//! Results for people and for machines, with errors as this program reports them: text and exit status.

use std::path::PathBuf;

use serde::Serialize;

/// Gives a result; an error has its text and the exit status.
pub fn give(
    json: &Option<PathBuf>,
    result: &impl Serialize,
    for_people: impl FnOnce() -> String,
) -> Result<(), (String, u8)> {
    dynocar::output::give(json.as_deref(), result, for_people)
        .map_err(|error| (error.to_string(), 1))
}
