//! The command line: `dynocar record`, `flight-recorder`, `keep` and `recover` become this program. It fails for wrong
//! input, or for work that could not be done.

mod record;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, CommandFactory, Parser, Subcommand};
use dynocar::cli::{Failure, carry_out};
use dynocar::output::{print, report_line, require_new};
use dynocar::programs::{RECORDING, called_as};

use super::page::page;
use super::record::{KeepError, RecordError};
use dynocar_mcap::copying::{read_all, recover};
use dynocar_mcap::reading::FileEnding;

pub use record::WantedArguments;

/// Recordings of the samples and snapshots of controller and daemon, as MCAP.
#[derive(Debug, Parser)]
#[command(name = "dynocar", bin_name = "dynocar", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Record(record::RecordArguments),
    FlightRecorder(record::FlightRecorderArguments),
    Keep(record::KeepArguments),
    Recover(RecoverArguments),
    /// Print the reference page of the recorded fields
    #[command(hide = true)]
    Fields,
}

/// Repair a truncated recording, or join the files of one that rotated.
#[derive(Debug, Args)]
struct RecoverArguments {
    /// The broken file, or all files of a recording in their order; they stay as they are
    #[arg(required = true)]
    broken: Vec<PathBuf>,
    /// The whole file
    #[arg(short, long, value_name = "FILE.mcap")]
    output: PathBuf,
}

/// The exit status where something of a recording is lost.
const LOST: u8 = 3;

/// Returns the command line of the recording's commands.
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Parses the command line, runs the command, reports a failure on standard error.
pub fn main() -> ExitCode {
    carry_out(called_as(RECORDING), |arguments: &Arguments| match &arguments.command {
        Command::Record(arguments) => record::execute(arguments),
        Command::FlightRecorder(arguments) => record::execute_flight_recorder(arguments),
        Command::Keep(arguments) => record::execute_keep(arguments),
        Command::Recover(arguments) => execute_recover(arguments),
        Command::Fields => print(&page()).map_err(Failure::from),
    })
}

fn execute_recover(arguments: &RecoverArguments) -> Result<(), Failure> {
    require_new(&arguments.output)?;
    // Those of two daemons are refused before anything is written.
    read_all(&arguments.broken, &mut ()).map_err(Failure::from)?;
    let recovered = recover(&arguments.broken, &arguments.output)?;
    let lost: Vec<String> =
        arguments.broken.iter().zip(&recovered.endings).filter_map(lost).collect();
    let is_whole = lost.is_empty();
    let lost =
        if lost.is_empty() { "nothing is lost: it was whole".to_owned() } else { lost.join("; ") };
    report_line(&format!(
        "{}: {} messages and {} attached files recovered; {lost}",
        arguments.output.display(),
        recovered.messages,
        recovered.attachments
    ));
    if is_whole { Ok(()) } else { Err(Failure::Verdict(LOST)) }
}

/// Returns the description of a file's losses, unless the file is whole.
fn lost((path, ending): (&PathBuf, &FileEnding)) -> Option<String> {
    let FileEnding::Broken { read_bytes, file_bytes, reason } = ending else { return None };
    let rest = file_bytes.saturating_sub(*read_bytes);
    let path = path.display();
    Some(format!(
        "lost of {path}: what was not written, and the last {rest} of {file_bytes} bytes ({reason})"
    ))
}

/// A name that is taken is wrong input.
impl From<RecordError> for Failure {
    fn from(error: RecordError) -> Self {
        match error {
            RecordError::Taken { .. } | RecordError::Ring(KeepError::Taken { .. }) => {
                Failure::input(error)
            }
            error => Failure::work(error),
        }
    }
}
