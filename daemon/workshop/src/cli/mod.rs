//! The commands of the workshop, one file each; `check`, `explain` and `identify` serve other callers, too. Users call
//! them through `dynocar`.

pub mod brakes;
pub mod check;
mod convert;
mod documents;
pub mod explain;
mod explained;
pub mod explained_runs;
mod fmu;
pub mod identify;
mod import;
mod init;
mod learn;
mod stops;
mod survey;
mod threads;
mod train_text;
mod verify;

use std::path::Path;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use dynocar::cli::check::CheckArguments;
use dynocar::cli::replay::{self, ReplayArguments};
use dynocar::cli::{Failure, parse};

use crate::dataset::load;

/// Dynocar, a dynamometer car in software: the workshop, which `dynocar` calls.
#[derive(Debug, Parser)]
#[command(name = "dynocar", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Init(init::InitArguments),
    Import(import::ImportArguments),
    Explain(explain::ExplainArguments),
    Check(CheckArguments),
    Identify(identify::IdentifyArguments),
    Stops(stops::StopsArguments),
    Brakes(brakes::BrakesArguments),
    Survey(survey::SurveyArguments),
    Fmu(fmu::FmuArguments),
    Learn(learn::LearnArguments),
    Convert(convert::ConvertArguments),
    #[command(hide = true)]
    Verify(verify::VerifyArguments),
    #[command(hide = true)]
    Play(ReplayArguments),
    Completions(documents::CompletionsArguments),
    Man(documents::ManArguments),
}

impl Command {
    fn execute(&self) -> Result<(), Failure> {
        match self {
            Command::Init(arguments) => init::execute(arguments),
            Command::Import(arguments) => import::execute(arguments),
            Command::Explain(arguments) => explain::execute(arguments),
            Command::Check(arguments) => check::run(arguments),
            Command::Identify(arguments) => identify::execute(arguments),
            Command::Stops(arguments) => stops::execute(arguments),
            Command::Brakes(arguments) => brakes::execute(arguments),
            Command::Survey(arguments) => survey::execute(arguments),
            Command::Fmu(arguments) => fmu::execute(arguments),
            Command::Learn(arguments) => learn::execute(arguments),
            Command::Convert(arguments) => convert::execute(arguments),
            Command::Verify(arguments) => verify::execute(arguments),
            Command::Play(arguments) => replay::execute(arguments, |source| load(source)),
            Command::Completions(arguments) => documents::complete(arguments, all_commands()),
            Command::Man(arguments) => documents::write_manual(arguments, all_commands()),
        }
    }

    /// Returns where machines want the result.
    fn json(&self) -> Option<&Path> {
        let json = match self {
            Command::Explain(arguments) => &arguments.json,
            Command::Identify(arguments) => &arguments.json,
            Command::Stops(arguments) => &arguments.json,
            Command::Brakes(arguments) => &arguments.json,
            Command::Survey(arguments) => &arguments.json,
            // `check` has an answer of its own for errors.
            _ => return None,
        };
        json.as_deref()
    }
}

/// Returns the commands of `dynocar`, those of the workshop with their own options.
fn all_commands() -> clap::Command {
    let own = Arguments::command();
    own.get_subcommands()
        .filter(|it| !it.is_hide_set())
        .fold(dynocar::cli::commands(), |all, command| {
            all.mut_subcommand(command.get_name(), |_| command.clone())
        })
}

/// Returns all commands of the workshop, with their options.
pub fn commands() -> clap::Command {
    Arguments::command()
}

/// Carries out a command line, for a caller in the same process.
///
/// # Errors
///
/// A command line that is wrong is an input failure; else as the command.
pub fn execute<'w>(words: impl IntoIterator<Item = &'w str>) -> Result<(), Failure> {
    let words = std::iter::once("dynocar").chain(words);
    Arguments::try_parse_from(words).map_err(Failure::input)?.command.execute()
}

/// Parses the command line, runs the command, reports a failure on standard error.
pub fn main() -> ExitCode {
    let arguments = match parse::<Arguments>("dynocar") {
        Ok(arguments) => arguments,
        Err(status) => return status,
    };
    match arguments.command.execute() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report("dynocar", arguments.command.json()),
    }
}
