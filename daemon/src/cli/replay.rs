//! `dynocar replay`: recorded runs into the sample channel, as a controller would.

use std::ffi::OsString;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use dynocar_dataset::{Dataset, DatasetHead, Run, formats};
use dynocar_shared::{PipelineKind, TrainId};
use dynocar_transport::Host;

use super::Failure;
use super::failure::{Passed, become_it, words_of_command};
use crate::dataset::{self, DatasetSource, LoadError};
use crate::output::{Redrawn, bar, can_draw, report_line};
use crate::programs::WORKSHOP;
use crate::replay::{Rate, ReplayReport, Replayer};

/// How often progress is shown.
const SHOW_EVERY: Duration = Duration::from_millis(100);
/// Letters of the bar of samples.
const BAR_LETTERS: usize = 40;

/// Play recorded runs to the daemon as a controller would, or verify a recording.
#[derive(Debug, Args)]
pub struct ReplayArguments {
    /// The dataset's folder, or a recording; with --verify the files of one that rotated, in order
    #[arg(required = true)]
    dataset: Vec<PathBuf>,
    /// Play nothing: compute every snapshot of a recording again and say whether each bit is the same
    #[arg(long, conflicts_with_all = ["run", "rate", "train", "wait"])]
    verify: bool,
    /// With --verify: also report the estimates of another configuration of the daemon
    #[arg(long, value_name = "FILE", requires = "verify")]
    with: Option<PathBuf>,
    /// Only this run, counted from 1
    #[arg(long, value_name = "N")]
    run: Option<usize>,
    /// How many times as fast as recorded; max: as fast as the pipelines follow
    #[arg(long, default_value = "1", value_name = "1|K|max")]
    rate: Rate,
    /// The train's number on the channels; of a recording that holds several, this one is played
    #[arg(long, value_name = "ID")]
    train: Option<u64>,
    /// Wait so long for a daemon to announce itself before the first sample
    #[arg(long, default_value_t = 3.0, value_name = "SECONDS")]
    wait: f64,
}

/// Plays the runs of a dataset, or becomes the workshop, which knows the formats of recordings.
///
/// # Errors
///
/// As [`execute`], and when there is no such program.
pub fn execute_or_become(arguments: &ReplayArguments) -> Result<(), Failure> {
    if arguments.verify {
        let with = arguments.with.iter().flat_map(|it| ["--with".into(), it.into()]);
        let files = arguments.dataset.iter().map(OsString::from);
        let words = Passed::from(files.chain(with).collect::<Vec<_>>());
        return become_it(WORKSHOP, Some("verify"), &words);
    }
    if arguments.dataset.iter().any(|it| needs_workshop(it)) {
        return become_it(WORKSHOP, Some("play"), &words_of_command());
    }
    execute(arguments, |source| dataset::load(source))
}

/// Returns true for a recording, and for a dataset with runs that only a library reads.
fn needs_workshop(path: &Path) -> bool {
    let needs_library = |head: &DatasetHead| {
        head.manifest.runs.iter().any(|it| formats::of_run(&it.file).needs_library())
    };
    formats::of_recording(path).is_some()
        || dataset::open(path).is_ok_and(|(_, head)| needs_library(&head))
}

/// Plays the runs of the dataset that a function reads.
///
/// # Errors
///
/// A wrong dataset or run number is an input failure; a channel that cannot be opened, and samples
/// that nobody used, are a failure of the work.
pub fn execute(
    arguments: &ReplayArguments,
    read: impl Fn(DatasetSource) -> Result<Dataset, LoadError>,
) -> Result<(), Failure> {
    let [dataset] = &arguments.dataset[..] else {
        let words = "expected one dataset or recording: several files are for --verify";
        return Err(Failure::Input(words.into()));
    };
    let train = TrainId(arguments.train.unwrap_or(1));
    let dataset = of_train(dataset, arguments.train.map(TrainId), read)?;
    let runs = match arguments.run {
        None => &dataset.runs[..],
        Some(number) if (1..=dataset.runs.len()).contains(&number) => {
            &dataset.runs[number - 1..number]
        }
        Some(number) => {
            let last = dataset.runs.len();
            return Err(Failure::Input(format!("--run {number}: expected 1 to {last}")));
        }
    };
    let host = Host::from_environment().map_err(Failure::work)?;
    let mut replayer = Replayer::open(&host, train, arguments.rate).map_err(Failure::work)?;
    let wait = Duration::try_from_secs_f64(arguments.wait).map_err(|_| {
        Failure::Input(format!("--wait {}: expected a time in s from 0", arguments.wait))
    })?;
    if !replayer.await_daemon(wait) {
        report_line(&format!(
            "dynocar: no daemon serves train {} after {} s; publishing all the same",
            train.0, arguments.wait
        ));
    }
    for run in runs {
        let mut progress = Progress::of(run);
        replayer.play(&run.samples, |count| progress.show(count));
    }
    let report = replayer.finish();
    report_page(&report);
    if report.snapshots.is_empty() {
        return Err(Failure::Work(format!(
            "nobody took the samples: no daemon serves train {}",
            train.0
        )));
    }
    if report.was_used() {
        return Ok(());
    }
    let offered = report.published + report.refused;
    Err(Failure::Work(format!(
        "no pipeline used half of the {offered} samples; the rest was refused or lost as said above"
    )))
}

/// Reads the dataset to play. The only train of a recording may be played as another.
fn of_train(
    path: &Path,
    train: Option<TrainId>,
    read: impl Fn(DatasetSource) -> Result<Dataset, LoadError>,
) -> Result<Dataset, LoadError> {
    match read(DatasetSource { path, train }) {
        Err(LoadError::NoRecording { .. } | LoadError::Recording { .. }) => {
            read(DatasetSource { path, train: None })
        }
        read => read,
    }
}

/// How far a run is played, on a terminal.
struct Progress<'r> {
    run: &'r Run,
    redrawn: Option<Redrawn>,
    shown: Option<Instant>,
}

impl<'r> Progress<'r> {
    fn of(run: &'r Run) -> Self {
        let redrawn = (std::io::stderr().is_terminal() && can_draw()).then(Redrawn::default);
        Progress { run, redrawn, shown: None }
    }

    fn show(&mut self, count: usize) {
        let Some(redrawn) = &mut self.redrawn else { return };
        let total = self.run.samples.len();
        if count == total || self.shown.is_none_or(|last| last.elapsed() >= SHOW_EVERY) {
            self.shown = Some(Instant::now());
            let bar = bar(count as f64 / total.max(1) as f64, BAR_LETTERS);
            redrawn.draw(&[format!("{:20} {bar} {count}/{total}", self.run.file)]);
        }
    }
}

fn report_page(report: &ReplayReport) {
    report_line(&format!(
        "{} samples published in {:.1} s, {} not taken by the transport",
        report.published, report.elapsed_s, report.refused
    ));
    for snapshot in &report.snapshots {
        let kind = PipelineKind::from_number(snapshot.pipeline_kind);
        let taken = report.taken(snapshot);
        let reasons: Vec<String> =
            taken.reasons.iter().map(|(reason, count)| format!("{reason} {count}")).collect();
        let reasons =
            if reasons.is_empty() { String::new() } else { format!(" ({})", reasons.join(", ")) };
        report_line(&format!(
            "  pipeline {} ({}): {}, {} used, {} rejected{reasons}, {} lost",
            snapshot.pipeline_index,
            kind.map_or("unknown kind", PipelineKind::name),
            snapshot.status(),
            taken.used,
            taken.rejected,
            taken.lost
        ));
    }
}
