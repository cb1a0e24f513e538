//! The command line: `dynocar record`, `recover`, `convert` and `replay --verify` become this program.
//!
//! Failures of the command line: wrong input, or work that could not be done.

mod record;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, CommandFactory, Parser, Subcommand};
use dynocar::cli::replay::{self, ReplayArguments};
use dynocar::cli::{Failure, carry_out};
use dynocar::config::DaemonConfig;
use dynocar::output::{print, report_line, require_new};
use dynocar::programs::{RECORDING, called_as};

use super::page::page;
use super::record::{KeepError, RecordError};
use super::verify::{Configurations, Outcome, overlay, text, verify};
use dynocar_mcap::convert::{ModelFiles, Unpacked, from_dataset, to_dataset};
use dynocar_mcap::copying::recover;
use dynocar_mcap::dataset;
use dynocar_mcap::error::CopyError;
use dynocar_mcap::joining::read_all;
use dynocar_mcap::reading::Ending;
use dynocar_mcap::recording::Recording;

pub use record::WantedArguments;

/// Recordings of what a controller and the daemon write, as MCAP.
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
    Convert(ConvertArguments),
    #[command(hide = true)]
    Verify(VerifyArguments),
    #[command(hide = true)]
    Play(ReplayArguments),
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

/// Convert recordings between MCAP, CSV datasets and Parquet.
#[derive(Debug, Args)]
pub struct ConvertArguments {
    /// A recording, of one that rotated its files in order; or a dataset's folder or dataset.toml
    #[arg(required = true)]
    pub from: Vec<PathBuf>,
    /// The dataset's folder, or the recording as NAME.mcap or NAME.parquet; it must not be there yet
    #[arg(short, long, value_name = "TO")]
    pub output: PathBuf,
    /// For a dataset, only this train of the recording
    #[arg(long, value_name = "ID")]
    pub train: Option<u64>,
    /// The train's file, for a recording to which none is attached
    #[arg(long, value_name = "FILE")]
    train_file: Option<PathBuf>,
    /// The line's file, beside --train-file
    #[arg(long, value_name = "FILE", requires = "train_file")]
    track_file: Option<PathBuf>,
    /// Print only what is wrong
    #[arg(long)]
    pub quiet: bool,
}

impl ConvertArguments {
    /// The files of train and line that are given.
    pub fn model_files(&self) -> ModelFiles {
        ModelFiles { train: self.train_file.clone(), track: self.track_file.clone() }
    }

    /// The dataset to convert; `None` for recordings.
    pub fn dataset(&self) -> Option<&Path> {
        let is_dataset = |it: &Path| match it.extension().and_then(|it| it.to_str()) {
            Some("toml") => true,
            Some("parquet") => false,
            _ => it.is_dir(),
        };
        self.from.iter().map(PathBuf::as_path).find(|it| is_dataset(it))
    }

    /// Says what became of a recording.
    pub fn report(&self, unpacked: &Unpacked) {
        if let Some(broken) = &unpacked.broken {
            report_line(&format!("{}: {broken}; `dynocar recover` makes it whole", program()));
        }
        if !self.quiet {
            let Unpacked { runs, samples, left_out, .. } = unpacked;
            report_line(&format!(
                "{}: {runs} runs, {samples} samples; {left_out} snapshots and events have no place in \
                 a dataset",
                self.output.display()
            ));
        }
    }
}

/// Compute every recorded snapshot again.
#[derive(Debug, Args)]
pub struct VerifyArguments {
    /// The recording; of one that rotated, its files in order
    #[arg(required = true)]
    pub recording: Vec<PathBuf>,
    /// Also say what this configuration of the daemon would have estimated
    #[arg(long, value_name = "FILE")]
    with: Option<PathBuf>,
}

/// The exit status where something of a recording is lost.
const LOST: u8 = 3;

/// The name by which messages call this program.
fn program() -> &'static str {
    called_as(RECORDING)
}

/// The command line of the recording's commands.
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Parses the command line, runs the command, reports a failure on standard error.
pub fn main() -> ExitCode {
    carry_out(
        program(),
        |_| None,
        |arguments: &Arguments| match &arguments.command {
            Command::Record(arguments) => record::execute(arguments),
            Command::FlightRecorder(arguments) => record::execute_flight_recorder(arguments),
            Command::Keep(arguments) => record::execute_keep(arguments),
            Command::Recover(arguments) => execute_recover(arguments),
            Command::Convert(arguments) => execute_convert(arguments),
            Command::Verify(arguments) => execute_verify(arguments),
            Command::Play(arguments) => replay::execute(arguments, |source| dataset::load(source)),
            Command::Fields => print(&page()).map_err(Failure::from),
        },
    )
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
fn lost((path, ending): (&PathBuf, &Ending)) -> Option<String> {
    let Ending::Broken { read_bytes, file_bytes, reason } = ending else { return None };
    let rest = file_bytes.saturating_sub(*read_bytes);
    let path = path.display();
    Some(format!(
        "lost of {path}: what was not written, and the last {rest} of {file_bytes} bytes ({reason})"
    ))
}

fn execute_convert(arguments: &ConvertArguments) -> Result<(), Failure> {
    let ConvertArguments { from, output, train, quiet, .. } = arguments;
    require_new(output)?;
    if let Some(dataset) = arguments.dataset() {
        if from.len() > 1 {
            return Err(Failure::Input(format!("{}: expected no file beside", dataset.display())));
        }
        let samples = from_dataset(dataset, output)?;
        if !quiet {
            report_line(&format!("{}: {samples} samples", output.display()));
        }
        return Ok(());
    }
    arguments.report(&to_dataset(from, output, *train, &arguments.model_files())?);
    Ok(())
}

fn execute_verify(arguments: &VerifyArguments) -> Result<(), Failure> {
    arguments.verify(&Recording::load_all(&arguments.recording).map_err(CopyError::from)?)
}

impl VerifyArguments {
    /// Computes every snapshot of a recording again, and says what became of them.
    ///
    /// # Errors
    ///
    /// When it holds none, there is nothing to compute them by, or one is another.
    pub fn verify(&self, recording: &Recording) -> Result<(), Failure> {
        let path = &self.recording[0];
        if let Some(broken) = &recording.broken {
            report_line(&format!("{}: {broken}", program()));
        }
        if recording.snapshots.is_empty() {
            let words = "no snapshots: nothing to verify";
            return Err(Failure::Input(format!("{}: {words}", path.display())));
        }
        let configurations = Configurations::of(recording);
        let configurations =
            configurations.map_err(|it| Failure::Input(format!("{}: {it}", path.display())))?;
        let other = self.with.as_deref().map(DaemonConfig::load).transpose()?;
        let verified = verify(recording, &configurations);
        let (samples, snapshots) = (recording.samples.len(), recording.snapshots.len());
        let names = self.recording.iter().map(|it| it.display().to_string()).collect::<Vec<_>>();
        let names = names.join(", ");
        print(&format!("{names}: {samples} samples, {snapshots} snapshots\n"))?;
        print(&text(&verified))?;
        if let (Some(other), Some(file)) = (&other, &self.with) {
            let newest = verified.last().map_or(0, |it| it.epoch);
            let recorded = configurations.of_epoch(newest).0;
            print(&overlay([recorded, other], &recording.samples, &file.display().to_string()))?;
        }
        if verified.iter().all(|it| it.outcome == Outcome::Same) {
            Ok(())
        } else {
            Err(Failure::Verdict(1))
        }
    }
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
