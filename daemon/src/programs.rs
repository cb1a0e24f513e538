//! Programs beside this one: what they are built on is nothing that a daemon needs.

use std::ffi::OsString;
use std::io;
use std::path::PathBuf;
use std::process::Command;

/// The program of everything about recordings.
pub const RECORDING: &str = "dynocar-recording";

/// A call of a program that lies where this one lies; else the search path has it. It bears the name
/// of the package that it is built from.
pub fn call(package: &str) -> Command {
    Command::new(beside_this(package).unwrap_or_else(|| package.into()))
}

fn beside_this(package: &str) -> Option<OsString> {
    let this: PathBuf = std::env::current_exe().ok()?;
    let program = this.parent()?.join(package);
    program.is_file().then(|| program.into_os_string())
}

/// Why a program does not start, in words.
pub fn not_started(package: &str, error: &io::Error) -> String {
    if error.kind() == io::ErrorKind::NotFound {
        return format!(
            "this needs the program {package}, which is neither beside dynocar nor on the search \
             path; `cargo build --release -p {package}` makes it"
        );
    }
    format!("{package} cannot be started: {error}")
}
