//! The recorder: one more reader of the trains' channels, which nobody waits for.
//!
//! It takes samples at least every few milliseconds, for a channel holds the newest 512 of them; what
//! it passes over is counted, recorded and told. Its files can be read up to the last flush, whatever
//! ends it.

mod configuration;
mod files;
mod keeping;
mod lane;

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dynocar::output::tell;
use dynocar_client::{ChannelError, Host, Peer, Role, monotonic_now_ns};
use dynocar_shared::TrainId;
use mcap::McapError;

pub use files::{Files, Rotation};
pub use keeping::{Keeper, Keeping, request as request_keeping};

use lane::Lane;

/// How long the recorder sleeps between two looks at the channels: at 1 kHz a buffer of 512 samples
/// leaves it a hundred times as long.
const PAUSE: Duration = Duration::from_millis(5);
/// How often what was taken is handed to the system: what a kill costs at most.
const FLUSH: Duration = Duration::from_millis(400);
/// How often it looks who is there.
const LOOK: Duration = Duration::from_millis(200);

/// What is to be recorded, and where to.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The run-time directory.
    pub host: Host,
    /// The trains; every train that is there or comes, when empty.
    pub trains: Vec<TrainId>,
    /// The file; with rotation the beginning of the files' names.
    pub output: PathBuf,
    /// When a file is full.
    pub rotation: Rotation,
    /// A pipeline's snapshot is recorded when the last is so old, or its status is another.
    pub snapshot_interval: Duration,
    /// The daemon's configuration; by default the file that its command line names.
    pub configuration: Option<PathBuf>,
}

/// Why a recording ends.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// A channel cannot be opened.
    #[error(transparent)]
    Channel(#[from] ChannelError),
    /// The file's name is taken.
    #[error("{}: exists already, and is not overwritten: give another name", path.display())]
    Taken {
        /// The file.
        path: PathBuf,
    },
    /// A file cannot be written.
    #[error("{}: cannot be written: {}; what was written before can be read", path.display(), words(source))]
    Write {
        /// The file.
        path: PathBuf,
        /// What stopped it.
        source: McapError,
    },
}

/// What the system said, where it was the system.
fn words(error: &McapError) -> String {
    match error {
        McapError::Io(error) => error.to_string(),
        other => other.to_string(),
    }
}

/// What was recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Recorded {
    /// Samples written.
    pub samples: u64,
    /// Snapshots written.
    pub snapshots: u64,
    /// Events written.
    pub events: u64,
    /// Samples whose numbers were passed over.
    pub lost: u64,
}

/// Records until the flag is set.
///
/// # Errors
///
/// See [`RecordError`]; what was written by then can be read.
pub fn record(settings: &Settings, stop: &AtomicBool) -> Result<Recorded, RecordError> {
    let mut files = Files::begin(&settings.output, settings.rotation)?;
    let mut lanes = Vec::new();
    for &train in &settings.trains {
        lanes.push(Lane::open(settings, train, &mut files)?);
    }
    tell(&format!("recording into {}; Ctrl-C ends it", files.path().display()));
    let (mut looked, mut flushed): (Option<Instant>, Instant) = (None, Instant::now());
    while !stop.load(Ordering::Relaxed) {
        for lane in &mut lanes {
            lane.take(&mut files)?;
        }
        if looked.is_none_or(|it| it.elapsed() >= LOOK) {
            if settings.trains.is_empty() {
                open_newcomers(settings, &mut lanes, &mut files)?;
            }
            for lane in &mut lanes {
                lane.look(settings, &mut files)?;
            }
            looked = Some(Instant::now());
        }
        if flushed.elapsed() >= FLUSH {
            files.flush()?;
            flushed = Instant::now();
        }
        std::thread::sleep(PAUSE);
    }
    for lane in &mut lanes {
        lane.take(&mut files)?;
        lane.end(&mut files)?;
    }
    files.finish()
}

/// Opens the trains that a daemon serves or a controller drives by now.
fn open_newcomers(
    settings: &Settings,
    lanes: &mut Vec<Lane>,
    files: &mut Files,
) -> Result<(), RecordError> {
    for role in [Role::Daemon, Role::Controller] {
        for train in Peer::trains(&settings.host, role)? {
            if lanes.iter().all(|lane| lane.train() != train) {
                lanes.push(Lane::open(settings, train, files)?);
            }
        }
    }
    Ok(())
}

/// An event of a train, seen now.
fn event(train: TrainId, kind: crate::event::EventKind, text: String) -> crate::event::Event {
    crate::event::Event {
        monotonic_ns: monotonic_now_ns(),
        train_id: train.0,
        kind: kind as i32,
        text,
        ..Default::default()
    }
}
