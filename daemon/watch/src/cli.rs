//! The command line of `dynocar watch`.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use clap::{CommandFactory, Parser};
use dynocar::cli::{Failure, carry_out};
use dynocar::config::DaemonConfig;
use dynocar::ending::ProgramEnding;
use dynocar::observing::ObservedSelection;
use dynocar::redrawn::can_draw;
use dynocar_shared::TrainId;
use dynocar_transport::Host;

use crate::watcher::Watcher;
use crate::{plain, terminal};

/// Show in the terminal the estimates of a train, and which manoeuvre to drive next.
///
/// Quantities with 95 % intervals, residual and suspect, samples used, refused and lost. Without options
/// it shows all trains that any daemon of this host serves. Where standard output is no terminal it
/// writes a line a second for each train. NO_COLOR is respected; ? shows the keys.
#[derive(Debug, Parser)]
#[command(name = "dynocar watch", bin_name = "dynocar watch", version)]
struct Arguments {
    /// The daemon's configuration: its root, its trains and their declarations; the next manoeuvre is computed within
    /// the limits declared there
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Only this train; may be given several times
    #[arg(long = "train", value_name = "ID")]
    trains: Vec<u64>,
    /// A line a second for each train, on a terminal too; so it is where TERM is dumb or the locale is not of UTF-8
    #[arg(long)]
    plain: bool,
}

/// Returns the command line of `dynocar watch`.
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Parses the command line, watches until asked to end, reports a failure on standard error.
pub fn main() -> ExitCode {
    carry_out("dynocar watch", execute)
}

fn execute(arguments: &Arguments) -> Result<(), Failure> {
    let config = arguments.config.as_deref().map(DaemonConfig::load).transpose()?;
    let trains = wanted(arguments, config.as_ref())?;
    let root = config.as_ref().and_then(|config| config.process.root.as_deref());
    let host = Host::of(root).map_err(Failure::work)?;
    let ending = ProgramEnding::begin().map_err(Failure::work)?;
    terminal::end_though_stuck(Arc::clone(&ending.flag))
        .map_err(|error| Failure::Work(format!("watching for the end: {error}")))?;
    let mut watcher = Watcher::new(ObservedSelection { host, trains }, config);
    if arguments.plain || !std::io::stdout().is_terminal() || !can_draw() {
        return plain::run(&mut watcher, &ending);
    }
    let has_colour = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    terminal::run(&mut watcher, &ending, has_colour)
}

/// Returns the trains to show; empty for all there are.
fn wanted(arguments: &Arguments, config: Option<&DaemonConfig>) -> Result<Vec<TrainId>, Failure> {
    let asked: Vec<TrainId> = arguments.trains.iter().map(|&id| TrainId(id)).collect();
    let Some(config) = config else { return Ok(asked) };
    let known: Vec<TrainId> = config.trains.iter().map(|train| train.id).collect();
    if asked.is_empty() {
        return Ok(known);
    }
    match asked.iter().find(|id| !known.contains(id)) {
        None => Ok(asked),
        Some(id) => {
            let known: Vec<String> = known.iter().map(TrainId::to_string).collect();
            let known = known.join(", ");
            Err(Failure::Input(format!("--train {id}: the configuration has train {known}")))
        }
    }
}
