//! The command line: `dynocar record`, `recover`, `convert` and `replay --verify` become this program.

mod annotate;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::{ArgGroup, Args, Parser, Subcommand};
use dynocar::cli::{Failure, parse};
use dynocar::config::DaemonConfig;
use dynocar::output::{print, require_new, tell};
use dynocar::run::stop_on_signals;
use dynocar_client::Host;
use dynocar_shared::TrainId;

use crate::convert::{FromDatasetError, ModelFiles, ToDatasetError, from_dataset, to_dataset};
use crate::lanes::Wanted;
use crate::page::page;
use crate::reading::{Ending, ReadError};
use crate::record::{RecordError, Rotation, Settings, record};
use crate::recording::Recording;
use crate::recover::{RecoverError, recover};
use crate::verify::{Configurations, Outcome, overlay, overlay_text, text, verify};

/// Recordings of what a controller and the daemon write, as MCAP.
#[derive(Debug, Parser)]
#[command(name = "dynocar", bin_name = "dynocar", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Record(RecordArguments),
    Recover(RecoverArguments),
    Convert(ConvertArguments),
    #[command(hide = true)]
    Annotate(annotate::AnnotateArguments),
    #[command(hide = true)]
    Verify(VerifyArguments),
    /// Print the reference page of the recorded fields
    #[command(hide = true)]
    Fields,
}

/// Record what a controller and the daemon write, as MCAP.
#[derive(Debug, Args)]
#[command(group(ArgGroup::new("rotation").args(["rotate_mib", "rotate_minutes"]).multiple(true)))]
struct RecordArguments {
    /// The file; with --rotate-mib or --rotate-minutes the files' names are this with a number
    #[arg(short, long, value_name = "FILE.mcap")]
    output: PathBuf,
    #[command(flatten)]
    wanted: WantedArguments,
    /// The daemon's configuration to attach; by default the one that its command line names
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Begin a new file after so many MiB
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    rotate_mib: Option<u64>,
    /// Begin a new file after so many minutes
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    rotate_minutes: Option<u64>,
    /// Remove the oldest files when all take more than so many MiB
    #[arg(long, value_name = "N", requires = "rotation",
          value_parser = clap::value_parser!(u64).range(1..=100_000_000))]
    keep_mib: Option<u64>,
}

/// What a recorder or a live view reads.
#[derive(Debug, Args)]
pub struct WantedArguments {
    /// Only this train; may be given several times. By default every train that is there or comes
    #[arg(long = "train", value_name = "ID")]
    trains: Vec<u64>,
    /// The run-time directory; else the variable DYNOCAR_ROOT, else /tmp/dynocar-<user>
    #[arg(long, value_name = "DIR")]
    root: Option<PathBuf>,
    /// Take a pipeline's snapshot every so many ms, and each change of its status
    #[arg(long, value_name = "MS", default_value_t = 100)]
    snapshots_ms: u64,
}

impl WantedArguments {
    /// What is to be read.
    ///
    /// # Errors
    ///
    /// When there is no run-time directory.
    pub fn wanted(&self) -> Result<Wanted, Failure> {
        let host = match &self.root {
            Some(root) => Host::at(root),
            None => Host::from_environment(),
        };
        Ok(Wanted {
            host: host.map_err(|error| Failure::Work(error.to_string()))?,
            trains: self.trains.iter().copied().map(TrainId).collect(),
            snapshot_interval: Duration::from_millis(self.snapshots_ms),
        })
    }
}

/// Make a recording whole whose recorder died.
#[derive(Debug, Args)]
struct RecoverArguments {
    /// The broken file; it stays as it is
    broken: PathBuf,
    /// The whole file
    #[arg(short, long, value_name = "FILE.mcap")]
    output: PathBuf,
}

/// Change a recording into a dataset's folder, or a dataset into a recording.
#[derive(Debug, Args)]
struct ConvertArguments {
    /// A recording, or a dataset's folder or dataset.toml
    from: PathBuf,
    /// The dataset's folder, or the recording; it must not be there yet
    #[arg(short, long, value_name = "TO")]
    output: PathBuf,
    /// Of a recording, only this train
    #[arg(long, value_name = "ID")]
    train: Option<u64>,
    /// The train's file, for a recording to which none is attached
    #[arg(long, value_name = "FILE")]
    train_file: Option<PathBuf>,
    /// The line's file, beside --train-file
    #[arg(long, value_name = "FILE", requires = "train_file")]
    track_file: Option<PathBuf>,
    /// Tell only what is wrong
    #[arg(long)]
    quiet: bool,
}

/// Compute every recorded snapshot again.
#[derive(Debug, Args)]
struct VerifyArguments {
    /// The recording
    recording: PathBuf,
    /// Also say what this configuration of the daemon would have told
    #[arg(long, value_name = "FILE")]
    with: Option<PathBuf>,
}

/// Parses the command line, runs the command, reports a failure on standard error.
pub fn main() -> ExitCode {
    let arguments = match parse::<Arguments>("dynocar") {
        Ok(arguments) => arguments,
        Err(status) => return status,
    };
    let result = match &arguments.command {
        Command::Record(arguments) => execute_record(arguments),
        Command::Recover(arguments) => execute_recover(arguments),
        Command::Convert(arguments) => execute_convert(arguments),
        Command::Annotate(arguments) => annotate::execute(arguments),
        Command::Verify(arguments) => execute_verify(arguments),
        Command::Fields => print(&page()).map_err(Failure::from),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report("dynocar", None),
    }
}

const MIB: u64 = 1 << 20;

fn execute_record(arguments: &RecordArguments) -> Result<(), Failure> {
    let settings = Settings {
        wanted: arguments.wanted.wanted()?,
        output: arguments.output.clone(),
        rotation: Rotation {
            bytes: arguments.rotate_mib.map(|it| it * MIB),
            age: arguments.rotate_minutes.map(|it| Duration::from_secs(60 * it)),
            keep_bytes: arguments.keep_mib.map(|it| it * MIB),
            keep_age: None,
        },
        configuration: arguments.config.clone(),
    };
    let stop = stop_on_signals().map_err(|error| Failure::Work(error.to_string()))?;
    let recorded = record(&settings, &stop).map_err(|error| match error {
        RecordError::Taken { .. } => Failure::Input(error.to_string()),
        error => Failure::Work(error.to_string()),
    })?;
    tell(&format!(
        "{} samples, {} snapshots and {} events recorded, {} samples lost",
        recorded.samples, recorded.snapshots, recorded.events, recorded.lost
    ));
    Ok(())
}

fn execute_recover(arguments: &RecoverArguments) -> Result<(), Failure> {
    require_new(&arguments.output)?;
    let recovered = recover(&arguments.broken, &arguments.output).map_err(|error| match error {
        RecoverError::Read(error) => read_failure(error),
        error => Failure::Work(error.to_string()),
    })?;
    let lost = match recovered.ending {
        Ending::Whole => "nothing is lost: it was whole".to_owned(),
        Ending::Broken { read_bytes, file_bytes, reason } => {
            let rest = file_bytes.saturating_sub(read_bytes);
            format!(
                "lost: what was not written, and the last {rest} of {file_bytes} bytes ({reason})"
            )
        }
    };
    tell(&format!(
        "{}: {} messages and {} attached files recovered; {lost}",
        arguments.output.display(),
        recovered.messages,
        recovered.attachments
    ));
    Ok(())
}

/// A file that is no recording is wrong input; one that the system does not give is not there.
fn read_failure(error: ReadError) -> Failure {
    Failure::Input(error.to_string())
}

fn execute_convert(arguments: &ConvertArguments) -> Result<(), Failure> {
    let ConvertArguments { from, output, .. } = arguments;
    require_new(output)?;
    if from.is_dir() || from.extension().is_some_and(|it| it == "toml") {
        return execute_from_dataset(from, output, arguments.quiet);
    }
    let files =
        ModelFiles { train: arguments.train_file.clone(), track: arguments.track_file.clone() };
    let unpacked =
        to_dataset(from, output, arguments.train, &files).map_err(|error| match error {
            ToDatasetError::Output(error) => error.into(),
            error => Failure::Input(error.to_string()),
        })?;
    if let Some(broken) = &unpacked.broken {
        tell(&format!("dynocar: {broken}; `dynocar recover` makes it whole"));
    }
    if !arguments.quiet {
        tell(&format!(
            "{}: {} runs, {} samples; {} snapshots and events have no place in a dataset",
            output.display(),
            unpacked.runs,
            unpacked.samples,
            unpacked.left_out
        ));
    }
    Ok(())
}

fn execute_from_dataset(from: &Path, output: &Path, is_quiet: bool) -> Result<(), Failure> {
    let samples = from_dataset(from, output).map_err(from_dataset_failure)?;
    if !is_quiet {
        tell(&format!("{}: {samples} samples", output.display()));
    }
    Ok(())
}

fn from_dataset_failure(error: FromDatasetError) -> Failure {
    match error {
        FromDatasetError::Dataset(error) => error.into(),
        FromDatasetError::Write { .. } => Failure::Work(error.to_string()),
        error => Failure::Input(error.to_string()),
    }
}

fn execute_verify(arguments: &VerifyArguments) -> Result<(), Failure> {
    let path = &arguments.recording;
    let wrong = |error: &dyn std::fmt::Display| Failure::Input(error.to_string());
    let recording = Recording::load(path).map_err(|error| wrong(&error))?;
    if let Some(broken) = &recording.broken {
        tell(&format!("dynocar: {broken}"));
    }
    if recording.snapshots.is_empty() {
        return Err(wrong(&format!("{}: no snapshots: nothing to verify", path.display())));
    }
    let configurations = Configurations::of(path, &recording).map_err(|error| wrong(&error))?;
    let other = arguments.with.as_deref().map(DaemonConfig::load).transpose()?;
    let verified = verify(&recording, &configurations);
    let (samples, snapshots) = (recording.samples.len(), recording.snapshots.len());
    print(&format!("{}: {samples} samples, {snapshots} snapshots\n", path.display()))?;
    print(&text(&verified))?;
    if let (Some(other), Some(file)) = (&other, &arguments.with) {
        let newest = verified.last().map_or(0, |it| it.epoch);
        let recorded = overlay(configurations.of_epoch(newest).0, &recording.samples);
        let told = overlay(other, &recording.samples);
        print(&overlay_text(&recorded, &told, &file.display().to_string()))?;
    }
    if verified.iter().all(|it| it.outcome == Outcome::Same) {
        Ok(())
    } else {
        Err(Failure::Verdict(1))
    }
}
