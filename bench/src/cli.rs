//! The commands of `dynocar-bench`.

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use dynocar::cli::parse;
use dynocar::output::report_line;

use crate::brakes::BrakesBenchArguments;
use crate::drive::DriveArguments;
use crate::ending;
use crate::estimators::EstimatorsArguments;
use crate::explain::ExplainBenchArguments;
use crate::latency::LatencyArguments;
use crate::load::LoadArguments;
use crate::monitor::MonitorArguments;
use crate::open_loop::server::{PeerArguments, serve};
use crate::output::{BenchError, Usage};
use crate::papers::PapersArguments;
use crate::scenarios::ScenariosArguments;
use crate::survey::SurveyBenchArguments;

/// Measures Dynocar: accuracy against the statistical bound, speed, latency against the floor.
#[derive(Debug, Parser)]
#[command(name = "dynocar-bench", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Brakes(BrakesBenchArguments),
    Drive(DriveArguments),
    Estimators(EstimatorsArguments),
    Explain(ExplainBenchArguments),
    Latency(LatencyArguments),
    Load(LoadArguments),
    Monitor(MonitorArguments),
    Papers(PapersArguments),
    Scenarios(ScenariosArguments),
    Survey(SurveyBenchArguments),
    #[command(hide = true)]
    Peer(PeerArguments),
}

/// Returns the command line of `dynocar-bench`.
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Parses the command line, runs the command, reports a failure on standard error.
pub fn main() -> ExitCode {
    let arguments = match parse::<Arguments>("dynocar-bench") {
        Ok(arguments) => arguments,
        Err(status) => return status,
    };
    status(run(&arguments.command))
}

fn run(command: &Command) -> Result<(), BenchError> {
    // A peer ends when it is killed.
    if !matches!(command, Command::Peer(_)) {
        ending::begin()?;
    }
    match command {
        Command::Brakes(arguments) => arguments.run(),
        Command::Drive(arguments) => arguments.run(),
        Command::Estimators(arguments) => arguments.run(),
        Command::Explain(arguments) => arguments.run(),
        Command::Latency(arguments) => arguments.run(),
        Command::Load(arguments) => arguments.run(),
        Command::Monitor(arguments) => arguments.run(),
        Command::Papers(arguments) => arguments.run(),
        Command::Scenarios(arguments) => arguments.run(),
        Command::Survey(arguments) => arguments.run(),
        Command::Peer(arguments) => serve(arguments),
    }
}

fn status(result: Result<(), BenchError>) -> ExitCode {
    match result {
        Ok(()) if ending::is_due() => {
            report_line("dynocar-bench: ended by a signal: figures of what was done until then");
            ExitCode::from(ending::STATUS)
        }
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            report_line(&format!("dynocar-bench: {failure}"));
            ExitCode::from(if failure.is::<Usage>() { 2 } else { 1 })
        }
    }
}
