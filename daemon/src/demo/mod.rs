//! `dynocar demo`: the main job, end to end, with real processes.
//!
//! A controller process replays an embedded recorded run into shared memory, a daemon process
//! estimates, and this process is the client that polls each control cycle.

mod stage;
mod summary;
mod view;

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use dynocar_client::SnapshotReader;
use dynocar_shared::{ParameterSnapshot, TrainId};
use dynocar_transport::monotonic_now_ns;

pub use summary::{DemoAnswer, Summary};

use dynocar_dataset::Dataset;

use crate::dataset::{self, LoadError};
use crate::ending::{self, EndingError};
use stage::{Stage, StageError};
use summary::Latencies;
use view::DemoView;

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
