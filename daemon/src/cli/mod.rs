//! The commands of `dynocar`, one file each. The workshop and other programs carry out the commands that are not needed
//! next to a controller; a user calls them all by this name.
//!
//! Messages for people go to standard error, results to standard output. Exit status: 0 done,
//! 1 the work failed, 2 the command line or an input file is wrong; `health` has some of its own.

pub mod check;
mod failure;
mod health;
pub mod models;
pub mod replay;
pub mod run;
pub mod text;

pub use failure::Failure;

use std::ffi::OsString;
use std::fmt::Write;
use std::path::Path;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use crate::output::{OutputError, write_json};
use crate::programs::{ErrorDocument, LIVE, RECORDING, WATCH, WORKSHOP};
use failure::{Passed, become_it};

/// Dynocar, a dynamometer car in software.
#[derive(Debug, Parser)]
#[command(name = "dynocar", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

/// In the order of the help. A command with `Passed` is carried out by another program, whose help has the same line
/// (`tests/e2e/two_programs.rs`).
#[derive(Debug, Subcommand)]
enum Command {
    Demo(run::DemoArguments),
    /// Describe your train and your CSV recordings as TOML files.
    Init(Passed),
    /// Import trains and lines of railtoolkit, TTOBench or OSRD.
    Import(Passed),
    /// Find which effect the model lacks, add it, and report the error before and after.
    Explain(Passed),
    Run(run::RunArguments),
    Health(health::HealthArguments),
    Check(check::CheckArguments),
    Replay(replay::ReplayArguments),
    /// Estimate resistance, mass, adhesion and friction from recorded runs.
    Identify(Passed),
    /// Estimate deceleration and stopping distance from recorded stops, without forces.
    Stops(Passed),
    /// Estimate a brake's ETCS parameters and stopping distances from recorded stops.
    Brakes(Passed),
    /// Survey a line from recordings with GNSS: trips, chainage, stops, gradient.
    Survey(Passed),
    /// Write the estimators, or the train itself, as an FMU for a simulator.
    Fmu(Passed),
    /// Turn recorded runs into candidate models, while trains run.
    Learn(Passed),
    Models(models::ModelsArguments),
    /// Record the samples and snapshots of controller and daemon, as MCAP
    Record(Passed),
    /// Keep the last hours on disk, and for good the minutes around a suspicion or fault
    FlightRecorder(Passed),
    /// Ask a flight recorder to keep this moment for good
    Keep(Passed),
    /// Repair a truncated recording, or join the files of one that rotated
    Recover(Passed),
    /// Convert recordings between MCAP, CSV datasets and Parquet
    Convert(Passed),
    /// Show in the terminal the estimates of a train, and which manoeuvre to drive next
    Watch(Passed),
    /// Serve samples, snapshots and events live to Foxglove or Lichtblick
    Live(Passed),
    /// Print the completions for a shell.
    Completions(Passed),
    /// Write the manual pages, one for every command.
    Man(Passed),
}

impl Command {
    /// Carries the command out, or becomes the program that does.
    fn execute(&self) -> Result<(), Failure> {
        let workshop = |command, passed| become_it(WORKSHOP, Some(command), passed);
        let recording = |command, passed| become_it(RECORDING, Some(command), passed);
        match self {
            Command::Demo(arguments) => run::execute_demo(arguments),
            Command::Run(arguments) => run::execute(arguments),
            Command::Health(arguments) => health::execute(arguments),
            Command::Check(arguments) => check::execute(arguments),
            Command::Replay(arguments) => replay::execute_or_become(arguments),
            Command::Models(arguments) => models::execute(arguments),
            Command::Init(passed) => workshop("init", passed),
            Command::Import(passed) => workshop("import", passed),
            Command::Explain(passed) => workshop("explain", passed),
            Command::Identify(passed) => workshop("identify", passed),
            Command::Stops(passed) => workshop("stops", passed),
            Command::Brakes(passed) => workshop("brakes", passed),
            Command::Survey(passed) => workshop("survey", passed),
            Command::Fmu(passed) => workshop("fmu", passed),
            Command::Learn(passed) => workshop("learn", passed),
            Command::Completions(passed) => workshop("completions", passed),
            Command::Man(passed) => workshop("man", passed),
            Command::Record(passed) => recording("record", passed),
            Command::FlightRecorder(passed) => recording("flight-recorder", passed),
            Command::Keep(passed) => recording("keep", passed),
            Command::Recover(passed) => recording("recover", passed),
            Command::Convert(passed) => workshop("convert", passed),
            Command::Watch(passed) => become_it(WATCH, None, passed),
            Command::Live(passed) => become_it(LIVE, None, passed),
        }
    }

    /// Returns the file for the result as JSON; `check` writes its own answer for errors.
    fn json(&self) -> Option<&Path> {
        match self {
            Command::Demo(arguments) => arguments.json.as_deref(),
            _ => None,
        }
    }
}

/// Returns all commands, with the options of those that this program carries out itself.
pub fn commands() -> clap::Command {
    grouped(Arguments::command())
}

/// Parses the command line, runs the command, reports a failure on standard error.
pub fn main() -> ExitCode {
    let arguments = match parse_by::<Arguments>(commands(), "dynocar", help_of_command()) {
        Ok(arguments) => arguments,
        Err(status) => return status,
    };
    match arguments.command.execute() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report("dynocar", arguments.command.json()),
    }
}

/// Parses the command line of a program of the project, carries it out, and reports a failure to people.
pub fn carry_out<A: Parser>(
    program: &str,
    execute: impl FnOnce(&A) -> Result<(), Failure>,
) -> ExitCode {
    let arguments = match parse::<A>(program) {
        Ok(arguments) => arguments,
        Err(status) => return status,
    };
    match execute(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(program, None),
    }
}

/// Returns the command line of a program of the project; where it asks for help or is wrong, the exit
/// status after that was reported.
///
/// # Errors
///
/// The exit status.
pub fn parse<A: Parser>(program: &str) -> Result<A, ExitCode> {
    parse_by(A::command(), program, std::env::args_os().collect())
}

/// Returns the command line, `help COMMAND` as `COMMAND --help`: so that another program's command answers too.
fn help_of_command() -> Vec<OsString> {
    let mut words: Vec<OsString> = std::env::args_os().collect();
    if words.len() == 3 && words[1] == "help" && words[2] != "help" {
        words[1] = words.pop().unwrap_or_default();
        words.push("--help".into());
    }
    words
}

fn parse_by<A: Parser>(
    mut command: clap::Command,
    program: &str,
    words: Vec<OsString>,
) -> Result<A, ExitCode> {
    let matches = command.try_get_matches_from_mut(&words);
    let error = match matches.and_then(|mut it| A::from_arg_matches_mut(&mut it)) {
        Ok(arguments) => return Ok(arguments),
        Err(error) => error.format(&mut command),
    };
    let printed = error.print().and_then(|()| std::io::Write::flush(&mut std::io::stdout()));
    if error.use_stderr() {
        let wants_json = words.iter().any(|word| word == "--json=-")
            || words.windows(2).any(|pair| pair[0] == "--json" && pair[1] == "-");
        let message = error.render().to_string();
        let message = message.trim().trim_start_matches("error: ").to_string();
        if let (true, Some(error)) = (wants_json, Failure::Input(message).answer()) {
            // People know already; that machines cannot be informed changes no status.
            let _ = write_json(Path::new("-"), &ErrorDocument { error });
        }
        return Err(ExitCode::from(2));
    }
    match printed {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Failure::from(OutputError::StandardOutput(error)).report(program, None))
        }
        _ => Err(ExitCode::SUCCESS),
    }
}

/// Headings and their commands, in the order in which they are printed.
const GROUPS: [(&str, &[&str]); 5] = [
    ("Begin", &["demo", "init", "import", "check"]),
    ("Drive, with a controller", &["run", "health", "replay"]),
    (
        "Learn, from recorded runs",
        &["identify", "explain", "survey", "stops", "brakes", "learn", "models"],
    ),
    ("Look, and keep", &["watch", "record", "flight-recorder", "keep", "recover", "convert"]),
    ("Connect, with other programs", &["live", "fmu", "completions", "man"]),
];

/// Returns the program's command line with a help that lists its commands in groups.
fn grouped(command: clap::Command) -> clap::Command {
    let list = list(&command);
    command.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}{list}\n\nOptions:\n{{options}}\n\n\
         dynocar help COMMAND says more of one of them."
    ))
}

/// Returns the commands that there are, each with its first sentence, below the headings.
fn list(command: &clap::Command) -> String {
    let names = || command.get_subcommands().map(clap::Command::get_name);
    let width = names().map(str::len).max().unwrap_or_default();
    let mut list = String::new();
    for (heading, wanted) in GROUPS {
        let found: Vec<&clap::Command> =
            wanted.iter().filter_map(|name| command.find_subcommand(name)).collect();
        if !found.is_empty() {
            let _ = write!(list, "\n\n{heading}:");
        }
        for it in found {
            let about = it.get_about().map(ToString::to_string).unwrap_or_default();
            let _ = write!(list, "\n  {:width$}  {about}", it.get_name());
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_is_in_one_group_and_its_first_sentence_fits_a_line() {
        let command = commands();
        for it in command.get_subcommands().filter(|it| !it.is_hide_set()) {
            let name = it.get_name();
            let count =
                GROUPS.iter().flat_map(|(_, names)| *names).filter(|it| **it == name).count();
            assert_eq!(count, 1, "{name} is in {count} groups");
        }
        for line in list(&command).lines() {
            assert!(line.chars().count() <= 100, "{line}");
        }
    }
}
