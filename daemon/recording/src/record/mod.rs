//! The recorder: it writes the messages of the trains' channels into files, which can be read up to the last flush,
//! even after an abrupt end.

mod configuration;
mod files;
mod housekeeping;
mod keeping;
mod kept_event;
mod ring;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use configuration::{Configuration, Maintenance};
use dynocar::output::report_line;
use dynocar::storage::{Disk, SharedStorage, folder_of};
use dynocar_mcap::writing::McapError;
use dynocar_shared::TrainId;
use dynocar_transport::ChannelError;

use crate::train_channels::{ChannelSelection, PAUSE, Sink, TrainChannels};
use dynocar_mcap::event::{Event, EventKind};
use dynocar_mcap::topic::Message;

pub use files::RecordingFiles;
pub use housekeeping::Rotation;
pub use keeping::{EventKeeper, KeepError, Keeping, request as request_keeping};

/// Time between two flushes of the messages to the system: the most that a kill costs.
const FLUSH: Duration = Duration::from_millis(400);
/// Time between two writes of the flushed data to the disk, unless the settings give another: a power cut costs this, a
/// flush, and the time that the disk takes.
pub const SYNC: Duration = Duration::from_secs(1);

/// Contents and destination of a recording.
#[derive(Clone, Debug)]
pub struct RecorderSettings {
    /// Trains and pipelines to read.
    pub wanted: ChannelSelection,
    /// The file; with rotation the beginning of the files' names.
    pub output: PathBuf,
    /// When a file is full.
    pub rotation: Rotation,
    /// How often files are brought to the disk; `None` for never.
    pub sync: Option<Duration>,
    /// The daemon's configuration; by default the file that its command line names.
    pub configuration: Option<PathBuf>,
    /// Events kept for good in the folder of the files, for a flight recorder.
    pub keeping: Option<Keeping>,
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
    /// The system gives no thread for the slow work of the disk.
    #[error("no thread can be started that brings files to the disk: {0}")]
    Thread(std::io::Error),
    /// A flight recorder cannot have its ring.
    #[error(transparent)]
    Ring(#[from] KeepError),
    /// A file cannot be written.
    #[error("{}: cannot be written: {}; what was written before can be read", path.display(), words(source))]
    Write {
        /// The file.
        path: PathBuf,
        /// Error that stopped it.
        source: McapError,
    },
}

/// Returns the words of the system, where the error is the system's.
fn words(error: &McapError) -> String {
    match error {
        McapError::Io(error) => error.to_string(),
        other => other.to_string(),
    }
}

/// Summary of a recording.
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

impl Recorded {
    /// Returns all that was written.
    pub fn items(&self) -> u64 {
        self.samples + self.snapshots + self.events
    }
}

/// Records until the flag is set.
///
/// # Errors
///
/// See [`RecordError`]; messages written by then can be read.
pub fn record(settings: &RecorderSettings, stop: &AtomicBool) -> Result<Recorded, RecordError> {
    let folder = folder_of(&settings.output);
    let disk: SharedStorage = Arc::new(Disk);
    let keeper = |keeping| EventKeeper::begin(Arc::clone(&disk), folder, keeping);
    let keeper = settings.keeping.map(keeper).transpose()?;
    let RecorderSettings { output, rotation, sync, .. } = settings;
    let files = RecordingFiles::begin(disk, output, *rotation, *sync, keeper)?;
    let mut recorder = Recorder {
        files: files.keep_house_in_parallel()?,
        configuration: settings.configuration.clone(),
        maintenance: Maintenance::default(),
    };
    let mut channels =
        TrainChannels::open(settings.wanted.clone(), "dynocar-recorder", &mut recorder)?;
    report_line(&format!("recording into {}; Ctrl-C ends it", recorder.files.path().display()));
    let mut flushed = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        channels.take(&mut recorder)?;
        if flushed.elapsed() >= FLUSH {
            for event in recorder.maintenance.news() {
                recorder.take(Message::Event(&event))?;
            }
            recorder.files.flush()?;
            flushed = Instant::now();
        }
        std::thread::sleep(PAUSE);
    }
    channels.take(&mut recorder)?;
    for train in channels.trains() {
        let ended = Event::now(train, EventKind::RecordingEnded, format!("train {train}"));
        recorder.take(Message::Event(&ended))?;
    }
    recorder.files.finish()
}

/// Writes the received messages into files.
struct Recorder {
    files: RecordingFiles,
    /// The daemon's configuration, where it was named.
    configuration: Option<PathBuf>,
    maintenance: Maintenance,
}

impl Sink for Recorder {
    type Error = RecordError;

    fn take(&mut self, message: Message<'_>) -> Result<(), RecordError> {
        self.files.write(message)
    }

    fn opened(&mut self, train: TrainId) -> Result<(), RecordError> {
        let began = Event::now(train, EventKind::RecordingBegan, format!("train {train}"));
        self.take(Message::Event(&began))
    }

    fn daemon_came(&mut self, train: TrainId, process: u32) -> Result<(), RecordError> {
        match Configuration::new(self.configuration.as_deref(), process) {
            Ok(configuration) => {
                self.maintenance.follow(train, &configuration);
                self.files.attach(configuration)
            }
            Err(problem) => {
                report_line(&format!("train {train}: {problem}"));
                Ok(())
            }
        }
    }
}
