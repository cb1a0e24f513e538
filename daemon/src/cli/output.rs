//! Where results go: standard output and the file of `--json`.

use std::io::{ErrorKind, Write};
use std::path::Path;

use serde::Serialize;

use super::Failure;

/// Writes text to standard output; a reader that has gone away is no failure.
///
/// # Errors
///
/// When standard output cannot be written.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut output = std::io::stdout().lock();
    match output.write_all(text.as_bytes()).and_then(|()| output.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::Work(format!("standard output: {error}")))
        }
        _ => Ok(()),
    }
}

/// True when `--json` is to go to standard output, where then nothing else may go.
pub fn is_standard_output(file: &Path) -> bool {
    file == Path::new("-")
}

/// Writes a machine-readable result to a file, `-` for standard output.
///
/// # Errors
///
/// When it cannot be written.
pub fn write_json(file: &Path, value: &impl Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|error| Failure::Work(format!("{}: {error}", file.display())))?;
    if is_standard_output(file) {
        return print(&format!("{text}\n"));
    }
    std::fs::write(file, text + "\n")
        .map_err(|error| Failure::Work(format!("{}: {error}", file.display())))
}
