//! Programs next to this one, which link libraries that a daemon does not need, and the failure of a command as JSON.

use std::ffi::{OsStr, OsString};
use std::io;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde::Serialize;

/// The program for all work away from the controller.
pub const WORKSHOP: &str = "dynocar-workshop";
/// The program that records.
pub const RECORDING: &str = "dynocar-recording";
/// The program of the live screen.
pub const WATCH: &str = "dynocar-watch";
/// The program that serves viewers.
pub const LIVE: &str = "dynocar-live";

/// The program that measures this project, which calls others.
const BENCH: &str = "dynocar-bench";

/// All programs of the project.
const PROGRAMS: [&str; 6] = [USUAL, WORKSHOP, RECORDING, WATCH, LIVE, BENCH];

/// Name by which the user calls all of them.
const USUAL: &str = "dynocar";

/// Returns a call of a program in the folder of this one, or else on the search path. It bears the name
/// of the package that it is built from, with the ending of this one's: `dynocar-2` calls
/// `dynocar-workshop-2`.
pub fn call(package: &str) -> Command {
    let mut command = Command::new(next_to_this_program(package).unwrap_or_else(|| package.into()));
    command.arg0(USUAL);
    command
}

/// Returns the name that the user called: `dynocar` where that called the program, else the program itself.
pub fn called_as(package: &'static str) -> &'static str {
    let name = std::env::args_os().next().unwrap_or_default();
    let is_usual = Path::new(&name).file_name().is_some_and(|it| it == USUAL);
    if is_usual { USUAL } else { package }
}

fn next_to_this_program(package: &str) -> Option<OsString> {
    let this: PathBuf = std::env::current_exe().ok()?;
    let ending = this.file_name().and_then(OsStr::to_str).map_or("", ending);
    let program = this.parent()?.join(format!("{package}{ending}"));
    program.is_file().then(|| program.into_os_string())
}

/// Returns the rest of a file's name after the name of a program of the project; empty for another file.
fn ending(file: &str) -> &str {
    let endings = PROGRAMS.iter().filter_map(|program| file.strip_prefix(program));
    endings.min_by_key(|ending| ending.len()).unwrap_or("")
}

/// Returns why a program does not start, in words.
pub fn not_started(package: &str, error: &io::Error) -> String {
    if error.kind() == io::ErrorKind::NotFound {
        return format!(
            "this needs the program {package}, which is neither beside dynocar nor on the search \
             path; `cargo build --release -p {package}` makes it"
        );
    }
    format!("{package} cannot be started: {error}")
}

/// A failure for machines.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ErrorAnswer {
    /// As on standard error.
    pub message: String,
    /// The file where it is, when one is wrong.
    pub file: Option<String>,
    /// Line in the file, from 1.
    pub line: Option<usize>,
    /// Exit status of the command.
    pub exit_status: u8,
}

/// Document of an error in place of a result.
#[derive(Serialize)]
pub struct ErrorDocument {
    /// Reason for the missing result.
    pub error: ErrorAnswer,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_of_one_ending_find_each_other() {
        assert_eq!(["dynocar", "dynocar-workshop"].map(ending), ["", ""]);
        assert_eq!(["dynocar-2", "dynocar-workshop-2"].map(ending), ["-2", "-2"]);
        assert_eq!(ending("dynocar-bench"), "");
        assert_eq!(ending("python3"), "");
    }
}
