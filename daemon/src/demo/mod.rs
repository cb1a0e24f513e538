//! `dynocar demo`: the main job, end to end, with real processes.
//!
//! A controller process replays an embedded recorded run into shared memory, a daemon process
//! estimates, and this process is the client that polls each control cycle.
//!
//! The live view has one line for each pipeline and a progress bar of the samples; plain lines without a terminal.

mod stage;
mod summary;

pub use summary::{DemoAnswer, Summary};

use std::io::IsTerminal;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use dynocar_client::{Reading, SnapshotReader};
use dynocar_dataset::Dataset;
use dynocar_shared::{HALF_95, ParameterSnapshot, PipelineKind, TrainId};
use dynocar_transport::monotonic_now_ns;

use crate::dataset::{self, LoadError};
use crate::ending::{self, EndingError};
use crate::output::{Redrawn, bar, can_draw, report_line};
use stage::{Stage, StageError};
use summary::Latencies;

/// Number of the demo's train on the channels.
const TRAIN: TrainId = TrainId(1);
/// How often the view is drawn.
const DRAW_EVERY: Duration = Duration::from_millis(100);
/// How long the pipelines may take for the last samples.
const CATCH_UP: Duration = Duration::from_secs(5);

/// Why the demo failed.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    /// A process or file could not be had.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// The embedded dataset could not be read.
    #[error(transparent)]
    Dataset(#[from] LoadError),
    /// A channel could not be opened.
    #[error(transparent)]
    Channel(#[from] dynocar_transport::ChannelError),
    /// It could not learn when to end.
    #[error(transparent)]
    Ending(#[from] EndingError),
    /// Somebody wanted it to end; daemon and controller have ended, too.
    #[error("interrupted")]
    Interrupted,
}

/// Plays the demo at `rate` times the recorded rate, and returns the summary.
///
/// # Errors
///
/// See [`DemoError`].
pub fn play(rate: f64) -> Result<Summary, DemoError> {
    // Else the two other processes and the temporary folder would stay.
    let stop = ending::flag()?;
    let mut stage = Stage::build()?;
    let dataset = dataset::load(stage.dataset())?;
    let mut reader = SnapshotReader::open(stage.host(), TRAIN)?;
    stage.start_daemon()?;
    await_fresh(&mut reader, &mut stage)?;
    stage.start_controller(rate)?;

    let cycle = control_cycle(&dataset, rate);
    let total = dataset.runs.iter().map(|run| run.samples.len() as u64).sum();
    let mut view = DemoView::new(&dataset, total, rate);
    let mut latency = Latencies::default();
    let mut last_draw = Instant::now();
    let mut ended: Option<Instant> = None;
    loop {
        if stop.load(Ordering::Relaxed) {
            return Err(DemoError::Interrupted);
        }
        let news = reader.poll();
        let now_ns = monotonic_now_ns();
        if news > 0 {
            latency.record(&reader, now_ns);
        }
        if last_draw.elapsed() >= DRAW_EVERY {
            last_draw = Instant::now();
            view.draw(&reader, now_ns);
            stage.require_daemon()?;
            if ended.is_none() && stage.controller_has_ended()? {
                ended = Some(Instant::now());
            }
        }
        let slowest = reader.readings(now_ns).map(|it| it.snapshot.sample_sequence).min();
        let is_done = slowest.is_some_and(|sequence| sequence >= total);
        if ended.is_some_and(|since| is_done || since.elapsed() > CATCH_UP) {
            break;
        }
        std::thread::sleep(cycle);
    }
    view.draw(&reader, monotonic_now_ns());
    let snapshots: Vec<ParameterSnapshot> =
        reader.readings(monotonic_now_ns()).map(|reading| *reading.snapshot).collect();
    stage.stop_daemon()?;
    Ok(Summary { dataset, published: total, rate, snapshots, latency })
}

fn await_fresh(reader: &mut SnapshotReader, stage: &mut Stage) -> Result<(), DemoError> {
    loop {
        reader.poll();
        if reader.readings(monotonic_now_ns()).any(|reading| !reading.is_stale) {
            return Ok(());
        }
        stage.require_daemon()?;
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Returns the recorded sample period at this rate, but at least 100 µs.
fn control_cycle(dataset: &Dataset, rate: f64) -> Duration {
    let samples = &dataset.runs[0].samples;
    let recorded_ns = match &samples[..] {
        [first, second, ..] => second.time_ns - first.time_ns,
        _ => 200_000_000,
    };
    Duration::from_nanos((recorded_ns as f64 / rate).max(1e5) as u64)
}

/// How often a plain line is written for each pipeline.
const PLAIN_EVERY: Duration = Duration::from_secs(3);

/// Width of the progress bar in characters.
const BAR_LETTERS: usize = 40;

/// Shows the estimates as they come.
pub struct DemoView {
    total: u64,
    /// Drawing on the terminal; `None` without a terminal.
    redrawn: Option<Redrawn>,
    last_plain: Option<Instant>,
}

impl DemoView {
    /// Returns a view of the replay of a dataset with `total` samples.
    pub fn new(dataset: &Dataset, total: u64, rate: f64) -> Self {
        report_line(&format!(
            "{}: {} recorded runs at {rate} times their speed",
            dataset.train.name,
            dataset.runs.len()
        ));
        report_line("controller, daemon and client are three processes; ± is a 95 % interval");
        let redrawn = (std::io::stderr().is_terminal() && can_draw()).then(Redrawn::default);
        DemoView { total, redrawn, last_plain: None }
    }

    /// Shows the newest snapshots of the reader.
    pub fn draw(&mut self, reader: &SnapshotReader, now_ns: i64) {
        match &mut self.redrawn {
            Some(redrawn) => redrawn.draw(&lines(reader, now_ns, self.total)),
            None => {
                if self.last_plain.is_none_or(|last| last.elapsed() >= PLAIN_EVERY) {
                    self.last_plain = Some(Instant::now());
                    self.write_lines(reader, now_ns);
                }
            }
        }
    }

    fn write_lines(&self, reader: &SnapshotReader, now_ns: i64) {
        for reading in reader.readings(now_ns) {
            let percent = 100 * reading.snapshot.sample_sequence / self.total.max(1);
            report_line(&format!("{percent:3} %  {}", describe(&reading)));
        }
    }
}

/// Returns a line for each pipeline, and one for the samples.
fn lines(reader: &SnapshotReader, now_ns: i64, total: u64) -> Vec<String> {
    let done = reader.readings(now_ns).map(|it| it.snapshot.sample_sequence).max().unwrap_or(0);
    let bar = bar(done as f64 / total.max(1) as f64, BAR_LETTERS);
    let pipelines = reader.readings(now_ns).map(|reading| describe(&reading));
    pipelines.chain([format!("{bar} {done}/{total} samples")]).collect()
}

/// One line: kind, status, resistance at three speeds with the half width of its 95 % interval.
fn describe(reading: &Reading) -> String {
    let snapshot = reading.snapshot;
    let kind = PipelineKind::from_number(snapshot.pipeline_kind).map_or("?", PipelineKind::name);
    let status = reading.status().name();
    format!("{kind:<20} {status:<12} {}", describe_estimate(snapshot))
}

fn describe_estimate(snapshot: &ParameterSnapshot) -> String {
    if snapshot.speed_max_mps <= snapshot.speed_min_mps {
        return "no motion yet".into();
    }
    let middle = 0.5 * (snapshot.speed_min_mps + snapshot.speed_max_mps);
    let speeds = [snapshot.speed_min_mps.ceil(), middle.round(), snapshot.speed_max_mps.floor()];
    let points: Vec<String> = speeds
        .iter()
        .filter_map(|&speed_mps| {
            let estimate = snapshot.resistance_at(speed_mps)?;
            let half_width = HALF_95 * estimate.w0_std_n_per_kn;
            Some(format!("w0({speed_mps:.0} m/s) {:.2} ± {half_width:.2}", estimate.w0_n_per_kn))
        })
        .collect();
    if !points.is_empty() {
        return points.join("   ");
    }
    let count = (snapshot.parameter_count as usize).min(snapshot.values.len());
    (0..count)
        .filter_map(|index| {
            let parameter = dynocar_shared::Parameter::from_number(snapshot.parameters[index])?;
            let half_width = HALF_95 * snapshot.std(parameter)?;
            Some(format!("{} {:.3} ± {half_width:.3}", parameter.name(), snapshot.values[index]))
        })
        .collect::<Vec<_>>()
        .join("   ")
}
