//! Results for machines.

use std::io::Write;
use std::path::Path;

use serde::Serialize;

use super::Failure;

/// Writes a result as JSON into a file, or to standard output when the file is `-`.
///
/// # Errors
///
/// When the file cannot be written.
pub fn write_json(file: &Path, result: &impl Serialize) -> Result<(), Failure> {
    let failed =
        |error: String| Failure::Work(format!("{}: cannot be written: {error}", file.display()));
    let mut text =
        serde_json::to_string_pretty(result).map_err(|error| failed(error.to_string()))?;
    text.push('\n');
    let written = if file == Path::new("-") {
        std::io::stdout().write_all(text.as_bytes())
    } else {
        std::fs::write(file, text)
    };
    written.map_err(|error| failed(error.to_string()))
}
