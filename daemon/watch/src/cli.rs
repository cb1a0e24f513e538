//! The command line of `dynocar watch`, and lines where there is no terminal: one a second for each train.

use std::io::{ErrorKind, IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::{CommandFactory, Parser};
use dynocar::cli::{Failure, carry_out};
use dynocar::config::DaemonConfig;
use dynocar::ending::ProgramEnding;
use dynocar::observing::ObservedSelection;
use dynocar::output::{OutputError, can_draw, is_utf8};
use dynocar_shared::TrainId;
use dynocar_transport::Host;

use crate::state::TrainState;
use crate::terminal;
use crate::watcher::Watcher;
use crate::words::{daemon, residual, rows, samples};

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
        return print_lines(&mut watcher, &ending);
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

/// Time between two polls for snapshots.
const POLL_EVERY: Duration = Duration::from_millis(100);
/// Time between two writings.
const WRITE_EVERY: Duration = Duration::from_secs(1);

/// Writes lines until the program is to end, or until nobody reads them any more.
///
/// # Errors
///
/// When standard output cannot be written.
fn print_lines(watcher: &mut Watcher, ending: &ProgramEnding) -> Result<(), Failure> {
    // The first poll takes the snapshots that are there; a heartbeat brings them.
    let mut next = Instant::now() + WRITE_EVERY / 2;
    while !ending.is_due() {
        watcher.look();
        if Instant::now() >= next {
            next += WRITE_EVERY;
            let mut text: String =
                watcher.trains().into_iter().map(|train| line(train) + "\n").collect();
            if text.is_empty() {
                text = format!("no daemon serves any train under {}\n", watcher.place());
            }
            if std::io::stdout().is_terminal() && !is_utf8() {
                text = in_ascii(&text);
            }
            let mut output = std::io::stdout().lock();
            match output.write_all(text.as_bytes()).and_then(|()| output.flush()) {
                Err(error)
                    if error.kind() == ErrorKind::BrokenPipe || ending.is_terminal_gone() =>
                {
                    return Ok(());
                }
                Err(error) => return Err(OutputError::StandardOutput(error).into()),
                Ok(()) => {}
            }
        }
        std::thread::sleep(POLL_EVERY);
    }
    Ok(())
}

/// Returns the text for a terminal that knows no other letters.
fn in_ascii(text: &str) -> String {
    let letters =
        text.replace('±', "+-").replace('…', "...").replace('‰', "o/oo").replace('²', "2");
    letters.chars().map(|it| if it.is_ascii() { it } else { '?' }).collect()
}

/// Returns a train in a line.
pub fn line(train: &TrainState) -> String {
    let mut parts = vec![daemon(&train.daemon, None)];
    for row in rows(train, &[0.5]) {
        let words = [row.label.trim(), &row.number, &row.interval, row.unit];
        let value = words.into_iter().filter(|it| !it.is_empty()).collect::<Vec<_>>().join(" ");
        let state = match row.use_state {
            Some(state) if row.why.is_empty() => format!(" {state}"),
            Some(state) => format!(" {state} ({})", row.why),
            None => String::new(),
        };
        parts.push(value + &state);
    }
    if !train.pipelines.is_empty() {
        parts.extend(
            residual(train)
                .map(|(force, suspect)| format!("unexplained {force}, suspect {suspect}")),
        );
        parts.push(samples(train));
        parts.extend(train.advice.first().map(|advice| format!("next: {advice}")));
    }
    format!("train {}: {}", train.id, parts.join("; "))
}
