//! The commands of `dynocar`, one file each.
//!
//! Messages for people go to standard error, results to standard output. Exit status: 0 done,
//! 1 the work failed, 2 the command line or an input file is wrong; `health` has some of its own.

mod check;
mod demo;
mod explain;
mod health;
mod identify;
mod output;
mod replay;
mod run;
mod text;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

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
    Explain(explain::ExplainArguments),
    Run(run::RunArguments),
    Health(health::HealthArguments),
    Check(check::CheckArguments),
    Replay(replay::ReplayArguments),
    Identify(identify::IdentifyArguments),
}

/// Why a command ended without a result; says which exit status follows.
#[derive(Debug)]
pub enum Failure {
    /// The command line or an input file is wrong: exit status 2.
    Input(String),
    /// The work failed: exit status 1.
    Work(String),
    /// The result, already told, is bad news: this exit status.
    Verdict(u8),
}

/// Parses the command line, runs the command, reports a failure on standard error.
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let result: Result<(), Failure> = match &arguments.command {
        Command::Demo(arguments) => demo::execute(arguments),
        Command::Explain(arguments) => explain::execute(arguments),
        Command::Run(arguments) => run::execute(arguments),
        Command::Health(arguments) => health::execute(arguments),
        Command::Check(arguments) => check::run(arguments),
        Command::Replay(arguments) => replay::execute(arguments),
        Command::Identify(arguments) => identify::execute(arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Verdict(status)) => ExitCode::from(status),
        Err(Failure::Input(message)) => {
            eprintln!("dynocar: {message}");
            ExitCode::from(2)
        }
        Err(Failure::Work(message)) => {
            eprintln!("dynocar: {message}");
            ExitCode::from(1)
        }
    }
}
