//! The commands of the workshop, one file each, but `verify`, which is [`crate::verify`]; `check`, `explain`, `fmu` and
//! `identify` serve other callers, too. Users call them through `dynocar`.

pub mod brakes;
pub mod check;
mod convert;
pub mod explain;
pub mod explained_runs;
pub mod fmu;
pub mod identify;
mod import;
mod init;
mod learn;
mod stops;
mod survey;
mod threads;
mod train_text;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, CommandFactory, Parser, Subcommand};
use clap_complete::Shell;
use clap_mangen::Man;
use dynocar::cli::check::CheckArguments;
use dynocar::cli::replay::{self, ReplayArguments};
use dynocar::cli::{Failure, parse};
use dynocar::output::{print, report_line, require_folder, write_in_folder};

use crate::dataset::load;
use crate::verify::{self, VerifyArguments};

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
    Verify(VerifyArguments),
    #[command(hide = true)]
    Play(ReplayArguments),
    Completions(CompletionsArguments),
    Man(ManArguments),
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
            Command::Completions(arguments) => complete(arguments, all_commands()),
            Command::Man(arguments) => write_manual(arguments, all_commands()),
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

/// Write the manual pages, one for every command.
#[derive(Debug, Args)]
struct ManArguments {
    /// Write the pages into this folder, which is made where there is none
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
}

/// Writes the manual pages of these commands.
///
/// # Errors
///
/// When a page cannot be written.
fn write_manual(arguments: &ManArguments, commands: clap::Command) -> Result<(), Failure> {
    require_folder(&arguments.out)?;
    let pages = pages(commands)?;
    for (name, page) in &pages {
        write_in_folder(&arguments.out, name, page)?;
    }
    report_line(&format!("manual: {} pages in {}", pages.len(), arguments.out.display()));
    Ok(())
}

/// Returns every page with its file's name: the program's first, then its commands' in their order.
fn pages(commands: clap::Command) -> Result<Vec<(String, String)>, Failure> {
    // `help` says nothing that the pages do not.
    let mut commands = commands.disable_help_subcommand(true);
    commands.build();
    let own = std::iter::once(commands.clone());
    own.chain(commands.get_subcommands().cloned()).map(page).collect()
}

fn page(command: clap::Command) -> Result<(String, String), Failure> {
    let source = concat!("dynocar ", env!("CARGO_PKG_VERSION"));
    let page = Man::new(command).source(source);
    let name = page.get_filename();
    let mut text = Vec::new();
    page.render(&mut text).map_err(|error| Failure::Work(format!("{name}: {error}")))?;
    Ok((name, String::from_utf8_lossy(&text).into_owned()))
}

/// Print the completions for a shell.
#[derive(Debug, Args)]
struct CompletionsArguments {
    /// The shell
    shell: Shell,
}

/// Prints a shell's completions of these commands.
///
/// # Errors
///
/// When standard output cannot be written.
fn complete(arguments: &CompletionsArguments, mut commands: clap::Command) -> Result<(), Failure> {
    let name = commands.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut commands, name, &mut script);
    Ok(print(&String::from_utf8_lossy(&script))?)
}
