//! Commands that programs of their own carry out: what they are built on is nothing that a daemon needs.

use std::ffi::{OsStr, OsString};
use std::io;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::Command;

use clap::Args;

use super::Failure;

/// What follows a command whose program reads it itself.
#[derive(Debug, Args)]
#[command(disable_help_flag = true)]
pub struct Passed {
    /// Options, as the command's own `--help` tells them
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "OPTIONS")]
    words: Vec<OsString>,
}

/// Becomes the program that carries out a command, with the command's words.
///
/// `package` is the program's name and that of the package it is built from; `command` is the word that
/// the program knows this command by, where it has several.
///
/// # Errors
///
/// Only when there is no such program, or it cannot be started.
pub fn become_it(package: &str, command: Option<&str>, passed: &Passed) -> Result<(), Failure> {
    let program = beside_this(package).unwrap_or_else(|| package.into());
    let error = command_line(&program, command, &passed.words).exec();
    Err(not_started(package, &error))
}

fn command_line(program: &OsStr, command: Option<&str>, words: &[OsString]) -> Command {
    let mut line = Command::new(program);
    line.args(command).args(words);
    line
}

/// The program where this one lies; else the search path has it.
fn beside_this(package: &str) -> Option<OsString> {
    let this: PathBuf = std::env::current_exe().ok()?;
    let program = this.parent()?.join(package);
    program.is_file().then(|| program.into_os_string())
}

fn not_started(package: &str, error: &io::Error) -> Failure {
    if error.kind() == io::ErrorKind::NotFound {
        return Failure::Work(format!(
            "this command needs the program {package}, which is neither beside dynocar nor on the \
             search path; `cargo build --release -p {package}` makes it"
        ));
    }
    Failure::Work(format!("{package} cannot be started: {error}"))
}
