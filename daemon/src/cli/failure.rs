//! How a command ends: its failure, with words, place and exit status, or another program that carries it out.

use std::ffi::OsString;
use std::fmt::Display;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::ExitCode;

use clap::Args;
use dynocar_dataset::{DatasetError, SourcePosition};

use crate::config::ConfigError;
use crate::dataset::LoadError;
use crate::output::{OutputError, report_line, require_file, write_json};
use crate::programs::{ErrorAnswer, ErrorDocument, call, not_started};

/// Why a command ended without a result; determines the exit status.
#[derive(Debug)]
pub enum Failure {
    /// The command line or an input file is wrong: exit status 2.
    Input(String),
    /// An input file is wrong at a known place: exit status 2.
    At(SourcePosition, String),
    /// The work failed: exit status 1.
    Work(String),
    /// A result cannot be given: exit status 1, or 2 when its name would cost data.
    Output(OutputError),
    /// The result, already reported, is bad news: this exit status.
    Verdict(u8),
}

impl Failure {
    /// Returns a failure of the work, in the words of an error.
    pub fn work(error: impl Display) -> Self {
        Failure::Work(error.to_string())
    }

    /// Returns a failure of the input, in the words of an error.
    pub fn input(error: impl Display) -> Self {
        Failure::Input(error.to_string())
    }

    /// Returns a failure of an input file, in the words of an error.
    fn at(path: &Path, message: String) -> Self {
        Failure::At(SourcePosition::whole(&path.display().to_string()), message)
    }

    /// Returns the failure for machines; `None` when the result is reported already.
    pub fn answer(&self) -> Option<ErrorAnswer> {
        let (message, position, exit_status) = match self {
            Failure::Input(message) => (message.clone(), None, 2),
            Failure::At(position, message) => (message.clone(), Some(position), 2),
            Failure::Work(message) => (message.clone(), None, 1),
            Failure::Output(error) => {
                let is_name = matches!(error, OutputError::Name { .. });
                (error.to_string(), None, if is_name { 2 } else { 1 })
            }
            Failure::Verdict(_) => return None,
        };
        let (file, line) = position.map_or((None, None), |it| (Some(it.file.clone()), it.line));
        Some(ErrorAnswer { message, file, line, exit_status })
    }

    /// Reports to people on standard error, and machines where they wanted the result.
    pub fn report(&self, program: &str, json: Option<&Path>) -> ExitCode {
        let Some(error) = self.answer() else {
            let Failure::Verdict(status) = self else { return ExitCode::FAILURE };
            return ExitCode::from(*status);
        };
        report_line(&format!("{program}: {}", error.message));
        let status = ExitCode::from(error.exit_status);
        if let Some(file) = json
            && self.can_be_estimated_in(file)
            && let Err(error) = write_json(file, &ErrorDocument { error })
        {
            report_line(&format!("{program}: {error}"));
        }
        status
    }

    /// False where the file holds the result already, cannot be written or must not be.
    fn can_be_estimated_in(&self, file: &Path) -> bool {
        match self {
            Failure::Output(OutputError::StandardOutput(_)) => false,
            Failure::Output(OutputError::File { path, .. } | OutputError::Name { path, .. })
                if path == file =>
            {
                false
            }
            _ => require_file(file, "{").is_ok(),
        }
    }
}

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Self {
        Failure::Output(error)
    }
}

impl From<DatasetError> for Failure {
    fn from(error: DatasetError) -> Self {
        Failure::At(error.place.clone(), error.to_string())
    }
}

impl From<LoadError> for Failure {
    fn from(error: LoadError) -> Self {
        let message = error.to_string();
        match error {
            LoadError::Dataset(error) => error.into(),
            LoadError::Recording { path, .. }
            | LoadError::NoSuchPath { path }
            | LoadError::NotADataset { path, .. }
            | LoadError::NoManifest { path, .. }
            | LoadError::NoRecording { path } => Failure::at(&path, message),
        }
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Self {
        let message = error.to_string();
        match error {
            ConfigError::Model(error) => error.into(),
            ConfigError::Root(_) => Failure::Input(message),
            ConfigError::Unreadable { path, .. } => Failure::at(&path, message),
            ConfigError::Malformed { place, .. } | ConfigError::OutOfRange { place, .. } => {
                Failure::At(place, message)
            }
        }
    }
}

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
