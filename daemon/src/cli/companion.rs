//! Commands that separate programs carry out.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;

use clap::Args;

use super::Failure;
use crate::programs::{call, not_started};

/// Arguments after a command that a separate program reads itself.
#[derive(Debug, Args)]
#[command(disable_help_flag = true)]
pub struct Passed {
    /// Options, as the command's own `--help` lists them
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "OPTIONS")]
    words: Vec<OsString>,
}

impl From<Vec<OsString>> for Passed {
    fn from(words: Vec<OsString>) -> Self {
        Passed { words }
    }
}

/// Returns the arguments after the command.
pub fn words_of_command() -> Passed {
    Passed { words: std::env::args_os().skip(2).collect() }
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
    let error = call(package).args(command).args(&passed.words).exec();
    Err(Failure::Work(not_started(package, &error)))
}
