//! Programs beside this one: what they are built on is nothing that a daemon needs.
//!
//! A failure for machines: for whoever asked for a result as JSON, and for a program of ours that called another.

use std::ffi::{OsStr, OsString};
use std::io::{self, BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde::{Deserialize, Serialize};

use crate::runtime::system::ends_with_this;

/// The program of what is done away from the controller.
pub const WORKSHOP: &str = "dynocar-workshop";
/// The program of everything about recordings.
pub const RECORDING: &str = "dynocar-recording";
/// The program of everything about Parquet.
pub const PARQUET: &str = "dynocar-parquet";
/// The program of the live screen.
pub const WATCH: &str = "dynocar-watch";
/// The program that serves viewers.
pub const LIVE: &str = "dynocar-live";

/// The program that measures this project, which calls others.
const BENCH: &str = "dynocar-bench";

/// All of them.
const PROGRAMS: [&str; 7] = [USUAL, WORKSHOP, RECORDING, PARQUET, WATCH, LIVE, BENCH];

/// Bytes of a program's output that are read at once.
const READ_AT_ONCE: usize = 1 << 16;

/// Name of the calling program that is usual.
const USUAL: &str = "dynocar";

/// A call of a program that lies where this one lies; else the search path has it. It bears the name
/// of the package that it is built from, with the ending of this one's: `dynocar-2` calls
/// `dynocar-workshop-2`.
pub fn call(package: &str) -> Command {
    let mut command = Command::new(beside_this(package).unwrap_or_else(|| package.into()));
    command.arg0(USUAL);
    command
}

/// Returns the name that the user called: `dynocar` where that called the program, else the program itself.
pub fn called_as(package: &'static str) -> &'static str {
    let name = std::env::args_os().next().unwrap_or_default();
    let is_usual = Path::new(&name).file_name().is_some_and(|it| it == USUAL);
    if is_usual { USUAL } else { package }
}

/// Why a program that was called did not do its work.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CallFailure {
    /// It found something wrong with what it was given: its words, without its name.
    Input(String),
    /// It did not start, or the work failed.
    Work(String),
}

impl CallFailure {
    /// The words.
    pub fn words(self) -> String {
        let (CallFailure::Input(words) | CallFailure::Work(words)) = self;
        words
    }
}

/// Calls a program that reports failures as [`ErrorDocument`], and waits for its end. Gives what is made of its
/// standard output while it comes, of which the rest may be a failure's document, and its diagnostics.
///
/// # Errors
///
/// In words when it does not start or does not end with 0.
pub fn taken_of<T>(
    package: &str,
    command: &mut Command,
    take: impl FnOnce(&mut dyn BufRead) -> T,
) -> Result<(T, String), CallFailure> {
    command
        .args(["--json", "-"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let program = ends_with_this(command).spawn();
    let mut program = program.map_err(|error| CallFailure::Work(not_started(package, &error)))?;
    let stdout = program.stdout.take();
    // Beside what it writes for us it may write on standard error as much as it likes.
    let (taken, output) = std::thread::scope(|threads| {
        let end = threads.spawn(move || program.wait_with_output());
        let mut rest = Vec::new();
        let taken = stdout.map(|it| {
            let mut input = BufReader::with_capacity(READ_AT_ONCE, it);
            let taken = take(&mut input);
            // How the program ended shows a broken pipe.
            let _ = input.read_to_end(&mut rest);
            taken
        });
        let end = end.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        (taken, end.map(|it| Output { stdout: rest, ..it }))
    });
    let output = output.map_err(|error| CallFailure::Work(format!("{package}: {error}")))?;
    let words = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    if output.status.success() {
        let taken = taken.map(|it| (it, words));
        return taken.ok_or_else(|| CallFailure::Work(format!("{package}: no standard output")));
    }
    Err(match serde_json::from_slice(&output.stdout) {
        Ok(ErrorDocument { error }) if error.exit_status == 2 => CallFailure::Input(error.message),
        Ok(ErrorDocument { error }) => CallFailure::Work(error.message),
        // It was killed.
        Err(_) => CallFailure::Work(format!("{package}: {}: {words}", output.status)),
    })
}

fn beside_this(package: &str) -> Option<OsString> {
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

/// A failure for machines.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
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
#[derive(Serialize, Deserialize)]
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
