//! The commands of `dynocar`, one file each; what `check`, `explain` and `identify` answer is there for
//! other callers, too.
//!
//! Messages for people go to standard error, results to standard output. Exit status: 0 done,
//! 1 the work failed, 2 the command line or an input file is wrong; `health` has some of its own.

pub mod check;
mod companion;
mod completions;
mod demo;
pub mod explain;
mod failure;
mod fmu;
mod health;
pub mod identify;
mod import;
mod init;
mod learn;
mod man;
mod models;
mod replay;
mod run;
mod stops;
mod survey;
mod text;
mod threads;
mod train_text;

use std::path::Path;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

pub use failure::{ErrorAnswer, Failure};

use crate::output::{OutputError, write_json};
use crate::programs::RECORDING;
use crate::unpacking::program_for;

/// Dynocar, a dynamometer car in software.
#[derive(Debug, Parser)]
#[command(name = "dynocar", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::DemoArguments),
    Init(init::InitArguments),
    Import(import::ImportArguments),
    Explain(explain::ExplainArguments),
    Run(run::RunArguments),
    Health(health::HealthArguments),
    Check(check::CheckArguments),
    Replay(replay::ReplayArguments),
    Identify(identify::IdentifyArguments),
    Stops(stops::StopsArguments),
    Survey(survey::SurveyArguments),
    Fmu(fmu::FmuArguments),
    Learn(learn::LearnArguments),
    Models(models::ModelsArguments),
    /// Record what a controller and the daemon write, as MCAP
    Record(companion::Passed),
    /// Keep the last hours in a ring on disk, and for good what lies around a suspicion or a fault
    FlightRecorder(companion::Passed),
    /// Ask a flight recorder to keep this moment for good
    Keep(companion::Passed),
    /// Make a recording whole whose recorder died
    Recover(companion::Passed),
    /// Change recordings between MCAP, CSV datasets and Parquet
    Convert(companion::Passed),
    /// See in the terminal what the daemon knows of a train, and what to drive next
    Watch(companion::Passed),
    /// Serve samples, snapshots and events live to Foxglove or Lichtblick
    Live(companion::Passed),
    /// Forward what the daemon knows to an MQTT broker, as Sparkplug B
    Forward(companion::Passed),
    Completions(completions::CompletionsArguments),
    Man(man::ManArguments),
}

impl Command {
    /// Where machines want the result.
    fn json(&self) -> Option<&Path> {
        match self {
            Command::Demo(arguments) => arguments.json.as_deref(),
            Command::Explain(arguments) => arguments.json.as_deref(),
            Command::Identify(arguments) => arguments.json.as_deref(),
            Command::Stops(arguments) => arguments.json.as_deref(),
            Command::Survey(arguments) => arguments.json.as_deref(),
            // `check` has an answer of its own for what is wrong.
            Command::Check(_) | Command::Run(_) | Command::Health(_) | Command::Replay(_) => None,
            Command::Init(_) | Command::Import(_) | Command::Fmu(_) => None,
            Command::Learn(_) | Command::Models(_) => None,
            Command::FlightRecorder(_) | Command::Keep(_) => None,
            Command::Record(_) | Command::Recover(_) | Command::Convert(_) | Command::Watch(_) => {
                None
            }
            Command::Live(_) | Command::Forward(_) => None,
            Command::Completions(_) | Command::Man(_) => None,
        }
    }
}

/// Parses the command line, runs the command, reports a failure on standard error.
pub fn main() -> ExitCode {
    let arguments = match parse::<Arguments>("dynocar") {
        Ok(arguments) => arguments,
        Err(status) => return status,
    };
    let result: Result<(), Failure> = match &arguments.command {
        Command::Demo(arguments) => demo::execute(arguments),
        Command::Init(arguments) => init::execute(arguments),
        Command::Import(arguments) => import::execute(arguments),
        Command::Explain(arguments) => explain::execute(arguments),
        Command::Run(arguments) => run::execute(arguments),
        Command::Health(arguments) => health::execute(arguments),
        Command::Check(arguments) => check::run(arguments),
        Command::Replay(arguments) => replay::execute(arguments),
        Command::Identify(arguments) => identify::execute(arguments),
        Command::Stops(arguments) => stops::execute(arguments),
        Command::Survey(arguments) => survey::execute(arguments),
        Command::Fmu(arguments) => fmu::execute(arguments),
        Command::Learn(arguments) => learn::execute(arguments),
        Command::Models(arguments) => models::execute(arguments),
        Command::Record(passed) => companion::become_it(RECORDING, Some("record"), passed),
        Command::FlightRecorder(passed) => {
            companion::become_it(RECORDING, Some("flight-recorder"), passed)
        }
        Command::Keep(passed) => companion::become_it(RECORDING, Some("keep"), passed),
        Command::Recover(passed) => companion::become_it(RECORDING, Some("recover"), passed),
        Command::Convert(passed) => {
            companion::become_it(program_for(passed.words()), Some("convert"), passed)
        }
        Command::Watch(passed) => companion::become_it("dynocar-watch", None, passed),
        Command::Live(passed) => companion::become_it("dynocar-live", None, passed),
        Command::Forward(passed) => companion::become_it("dynocar-forward", None, passed),
        Command::Completions(arguments) => completions::execute(arguments, Arguments::command()),
        Command::Man(arguments) => man::execute(arguments, Arguments::command()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report("dynocar", arguments.command.json()),
    }
}

/// The command line of a program of the project; where it asks for help or is wrong, the exit
/// status after that was told.
///
/// # Errors
///
/// The exit status.
pub fn parse<A: Parser>(program: &str) -> Result<A, ExitCode> {
    let error = match A::try_parse() {
        Ok(arguments) => return Ok(arguments),
        Err(error) => error,
    };
    let printed = error.print().and_then(|()| std::io::Write::flush(&mut std::io::stdout()));
    if error.use_stderr() {
        let words: Vec<_> = std::env::args_os().collect();
        let wants_json = words.iter().any(|word| word == "--json=-")
            || words.windows(2).any(|pair| pair[0] == "--json" && pair[1] == "-");
        let message = error.render().to_string();
        let message = message.trim().trim_start_matches("error: ").to_string();
        if let (true, Some(error)) = (wants_json, Failure::Input(message).answer()) {
            // People know already; that machines cannot be told changes no status.
            let _ = write_json(Path::new("-"), &failure::Answer { error });
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
