//! The command line: `dynocar record`, `flight-recorder`, `keep` and `recover` become this program. It fails for wrong
//! input, or for work that could not be done.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::{ArgGroup, Args, CommandFactory, Parser, Subcommand};
use dynocar::cli::{Failure, carry_out};
use dynocar::output::{print, report_line, require_new};
use dynocar::programs::{RECORDING, called_as};
use dynocar::{ending, observing};
use dynocar_mcap::copying::{read_all, recover};
use dynocar_mcap::reading::FileEnding;
use dynocar_shared::TrainId;
use dynocar_transport::Host;

use crate::page::page;
use crate::record::{
    KeepError, Keeping, RecordError, RecorderSettings, Rotation, SYNC, record, request_keeping,
};
use crate::train_channels::ChannelSelection;

/// Recordings of the samples and snapshots of controller and daemon, as MCAP.
#[derive(Debug, Parser)]
#[command(name = "dynocar", bin_name = "dynocar", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Record(RecordArguments),
    FlightRecorder(FlightRecorderArguments),
    Keep(KeepArguments),
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
        Command::Record(arguments) => execute_record(arguments),
        Command::FlightRecorder(arguments) => execute_flight_recorder(arguments),
        Command::Keep(arguments) => execute_keep(arguments),
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
            RecordError::Taken { .. }
            | RecordError::Folder { .. }
            | RecordError::Ring(KeepError::Taken { .. }) => Failure::input(error),
            error => Failure::work(error),
        }
    }
}

/// Record the samples and snapshots of controller and daemon, as MCAP.
#[derive(Debug, Args)]
#[command(group(ArgGroup::new("rotation").args(["rotate_mib", "rotate_minutes"]).multiple(true)))]
pub struct RecordArguments {
    /// The file; with --rotate-mib or --rotate-minutes the files' names are this with a number
    #[arg(short, long, value_name = "FILE.mcap")]
    output: PathBuf,
    #[command(flatten)]
    wanted: WantedArguments,
    /// The daemon's configuration to attach; by default the one that its command line names
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Begin a new file after this many MiB
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    rotate_mib: Option<u64>,
    /// Begin a new file after this many minutes
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    rotate_minutes: Option<u64>,
    /// Remove the oldest files when all take more than this many MiB
    #[arg(long, value_name = "N", requires = "rotation",
          value_parser = clap::value_parser!(u64).range(1..=100_000_000))]
    keep_mib: Option<u64>,
    #[command(flatten)]
    sync: SyncArguments,
}

/// Arguments that select the trains and pipelines for a recorder or a live view.
#[derive(Debug, Args)]
pub struct WantedArguments {
    /// Only this train; may be given several times. By default every train that is there or comes
    #[arg(long = "train", value_name = "ID")]
    trains: Vec<u64>,
    /// The run-time directory; else the variable DYNOCAR_ROOT, else /tmp/dynocar-USER
    #[arg(long, value_name = "DIR")]
    root: Option<PathBuf>,
    /// Take a pipeline's snapshot every this many ms, and each change of its status
    #[arg(long, value_name = "MS", default_value_t = 100)]
    snapshots_ms: u64,
}

impl WantedArguments {
    /// Returns the selection of trains and pipelines.
    ///
    /// # Errors
    ///
    /// When there is no run-time directory.
    pub fn wanted(&self) -> Result<ChannelSelection, Failure> {
        let host = Host::of(self.root.as_deref()).map_err(Failure::work)?;
        let trains = self.trains.iter().copied().map(TrainId).collect();
        Ok(ChannelSelection {
            trains: observing::ObservedSelection { host, trains },
            snapshot_interval: Duration::from_millis(self.snapshots_ms),
        })
    }
}

/// Arguments that limit the loss by a power cut.
#[derive(Debug, Args)]
pub struct SyncArguments {
    /// Sync the files to the disk every this many ms: the data that a power cut costs; 0 leaves it to the system
    #[arg(long, value_name = "MS", default_value_t = SYNC.as_millis() as u64,
          value_parser = clap::value_parser!(u64).range(0..=3_600_000))]
    sync_ms: u64,
}

impl SyncArguments {
    /// Returns how often; `None` for never.
    pub fn every(&self) -> Option<Duration> {
        (self.sync_ms > 0).then(|| Duration::from_millis(self.sync_ms))
    }
}

/// Bytes of a MiB.
pub const MIB: u64 = 1 << 20;

/// Records until it is asked to end.
///
/// # Errors
///
/// A name that is taken is an input failure.
fn execute_record(arguments: &RecordArguments) -> Result<(), Failure> {
    let settings = RecorderSettings {
        wanted: arguments.wanted.wanted()?,
        output: arguments.output.clone(),
        rotation: Rotation {
            bytes: arguments.rotate_mib.map(|it| it * MIB),
            age: arguments.rotate_minutes.map(|it| Duration::from_secs(60 * it)),
            keep_bytes: arguments.keep_mib.map(|it| it * MIB),
            keep_age: None,
        },
        sync: arguments.sync.every(),
        configuration: arguments.config.clone(),
        keeping: None,
    };
    run(&settings)
}

/// Records until it is asked to end, and reports how much that was.
///
/// # Errors
///
/// As above.
pub fn run(settings: &RecorderSettings) -> Result<(), Failure> {
    let stop = ending::flag().map_err(Failure::work)?;
    let recorded = record(settings, &stop)?;
    report_line(&format!(
        "{} samples, {} snapshots and {} events recorded, {} samples lost",
        recorded.samples, recorded.snapshots, recorded.events, recorded.lost
    ));
    Ok(())
}

/// The name by which the ring's files begin.
const RING: &str = "ring.mcap";
/// Files that a ring is made of, by age: with fewer, more is removed at once than need be.
const PARTS: u32 = 60;
/// The shortest and the longest time that a file of the ring takes.
const PART: [Duration; 2] = [Duration::from_secs(10), Duration::from_secs(600)];

/// Keep the last hours in a ring on disk, and for good the minutes around a suspicion, a fault or a request.
#[derive(Debug, Args)]
pub struct FlightRecorderArguments {
    /// The ring's folder, made where it is not there; kept files lie below it in `kept`
    folder: PathBuf,
    /// Hours that the ring reaches back
    #[arg(long, value_name = "N", default_value_t = 24.0, value_parser = hours)]
    hours: f64,
    /// The most MiB that the ring takes; the oldest go
    #[arg(long, value_name = "N", default_value_t = 4096,
          value_parser = clap::value_parser!(u64).range(1..=100_000_000))]
    ring_mib: u64,
    /// The most MiB that all that is kept takes; then nothing more is kept, and a line says so
    #[arg(long, value_name = "N", default_value_t = 4096,
          value_parser = clap::value_parser!(u64).range(1..=100_000_000))]
    kept_mib: u64,
    /// Seconds kept before a suspicion, a fault or a request
    #[arg(long, value_name = "S", default_value_t = 300,
          value_parser = clap::value_parser!(u64).range(1..=86_400))]
    before_s: u64,
    /// Seconds kept after it
    #[arg(long, value_name = "S", default_value_t = 300,
          value_parser = clap::value_parser!(u64).range(1..=86_400))]
    after_s: u64,
    #[command(flatten)]
    sync: SyncArguments,
    #[command(flatten)]
    wanted: WantedArguments,
    /// The daemon's configuration to attach; by default the one that its command line names
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

/// Ask a flight recorder to keep this moment for good.
#[derive(Debug, Args)]
pub struct KeepArguments {
    /// The ring's folder
    folder: PathBuf,
    /// Why, in words
    #[arg(short, long, value_name = "TEXT", default_value = "asked for")]
    reason: String,
}

fn hours(text: &str) -> Result<f64, String> {
    let hours = text.parse().ok().filter(|it| (0.01..=10_000.0).contains(it));
    hours.ok_or_else(|| "expected hours from 0.01 to 10000".to_owned())
}

/// Records until it is asked to end.
///
/// # Errors
///
/// A folder in which another recorder writes is an input failure.
fn execute_flight_recorder(arguments: &FlightRecorderArguments) -> Result<(), Failure> {
    let age = Duration::from_secs_f64(3600.0 * arguments.hours);
    let bytes = arguments.ring_mib * MIB;
    run(&RecorderSettings {
        wanted: arguments.wanted.wanted()?,
        output: arguments.folder.join(RING),
        rotation: Rotation {
            bytes: Some((bytes / u64::from(PARTS)).max(MIB / 4)),
            age: Some((age / PARTS).clamp(PART[0], PART[1])),
            keep_bytes: Some(bytes),
            keep_age: Some(age),
        },
        sync: arguments.sync.every(),
        configuration: arguments.config.clone(),
        keeping: Some(Keeping {
            before: Duration::from_secs(arguments.before_s),
            after: Duration::from_secs(arguments.after_s),
            most_bytes: arguments.kept_mib * MIB,
        }),
    })
}

/// Asks the recorder that writes into the folder.
///
/// # Errors
///
/// If there is no recorder in the folder.
fn execute_keep(arguments: &KeepArguments) -> Result<(), Failure> {
    let shown = arguments.folder.display();
    match request_keeping(&arguments.folder, &arguments.reason) {
        Ok(true) => {
            report_line(&format!("asked: what lies around this moment is kept in {shown}/kept"));
            Ok(())
        }
        Ok(false) => Err(Failure::Work(format!("{shown}: no flight recorder writes into it"))),
        Err(error) => Err(Failure::Input(format!("{shown}: {error}"))),
    }
}
