//! The recorder: it writes the messages of the trains' channels into files, which can be read up to the last flush,
//! even after an abrupt end.

mod files;
mod housekeeping;
mod keeping;
mod ring;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dynocar::dataset::read_text;
use dynocar::models::{ModelText, Store, TrainModels};
use dynocar::output::report_line;
use dynocar::storage::{Disk, SharedStorage, folder_of};
use dynocar_mcap::event::{Event, EventKind};
use dynocar_mcap::topic::Message;
use dynocar_mcap::writing::McapError;
use dynocar_shared::TrainId;
use dynocar_transport::ChannelError;
use toml::Table;

use crate::train_channels::{ChannelSelection, PAUSE, Sink, TrainChannels};

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
    /// The file cannot be made.
    #[error("{}: cannot be made: {source}", path.display())]
    Unmade {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// The name is a folder's.
    #[error("{}: expected the name of a new file, found a folder's", path.display())]
    Folder {
        /// The name.
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

/// A file to be attached: its name there and its content.
pub type File = (String, String);

/// A daemon's configuration, as it was found when the daemon was first seen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Configuration {
    /// Where it was found.
    pub path: PathBuf,
    /// `daemon.toml`, and `train-<id>.toml` and `track-<id>.toml` for each of its trains: those of the
    /// model in force, by the store that the configuration names.
    pub files: Vec<File>,
}

impl Configuration {
    /// Returns the configuration of the daemon of this process: the file given, else the one that its command
    /// line names.
    ///
    /// # Errors
    ///
    /// A sentence on the file that is not attached, and the reason.
    pub fn new(given: Option<&Path>, process: u32) -> Result<Self, String> {
        let named = match given {
            Some(path) => Some(path.to_path_buf()),
            None => named_by(process),
        };
        let path = named.ok_or_else(|| {
            format!(
                "the daemon (process {process}) does not publish its configuration: none is attached; \
                 give it by --config"
            )
        })?;
        Configuration::read(&path)
            .map_err(|problem| format!("the daemon's configuration is not attached: {problem}"))
    }

    /// Returns the directory of the store of models that it names.
    pub fn store(&self) -> Option<PathBuf> {
        let (_, text) = self.files.first()?;
        Some(self.path.parent()?.join(store_of(&text.parse().ok()?)?))
    }

    fn read(path: &Path) -> Result<Self, String> {
        let text = |path: &Path| read_text(path).map_err(|it| format!("{}: {it}", path.display()));
        let configuration = text(path)?;
        let table: Table =
            configuration.parse().map_err(|it| format!("{}: {it}", path.display()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut files = vec![("daemon.toml".to_owned(), configuration)];
        for train in table.get("trains").and_then(|it| it.as_array()).into_iter().flatten() {
            let id = train.get("id").and_then(|it| it.as_integer()).unwrap_or(0);
            if let Some(adopted) = adopted(&table, folder, id)? {
                files.push((format!("train-{id}.toml"), adopted.train));
                files.extend(adopted.track.map(|text| (format!("track-{id}.toml"), text)));
                continue;
            }
            for (key, name) in [("file", "train"), ("track", "track")] {
                if let Some(file) = train.get(key).and_then(|it| it.as_str()) {
                    files.push((format!("{name}-{id}.toml"), text(&folder.join(file))?));
                }
            }
        }
        Ok(Configuration { path: path.into(), files })
    }
}

/// Returns the model that the store of a configuration has put in force for a train; `None` where the declared model is
/// in force.
fn adopted(table: &Table, folder: &Path, train: i64) -> Result<Option<ModelText>, String> {
    let Some(directory) = store_of(table) else { return Ok(None) };
    let models = Store::at(&folder.join(directory)).train(TrainId(train as u64));
    let hash = models.in_force().map_err(|it| it.to_string())?;
    hash.map(|hash| models.text(hash).map_err(|it| it.to_string())).transpose()
}

fn store_of(configuration: &Table) -> Option<PathBuf> {
    Some(configuration.get("models")?.get("directory")?.as_str()?.into())
}

/// Returns the file behind `--config` in the command line of a process of this user.
fn named_by(process: u32) -> Option<PathBuf> {
    let folder = PathBuf::from(format!("/proc/{process}"));
    let line = std::fs::read(folder.join("cmdline")).ok()?;
    let mut words = line.split(|&byte| byte == 0).filter_map(|it| std::str::from_utf8(it).ok());
    let mut named = None;
    while let Some(word) = words.next() {
        if word == "--config" {
            named = words.next();
        } else if let Some(file) = word.strip_prefix("--config=") {
            named = Some(file);
        }
    }
    Some(std::fs::read_link(folder.join("cwd")).ok()?.join(named?))
}

/// How often it is looked for new ones.
const EVERY: Duration = Duration::from_secs(5);

/// The store of a daemon's configuration, and how far its events are known.
#[derive(Default)]
pub struct Maintenance {
    trains: BTreeMap<TrainId, (TrainModels, u64)>,
    looked: Option<Instant>,
}

impl Maintenance {
    /// From now on the events of a train by the store of its daemon's configuration.
    pub fn follow(&mut self, train: TrainId, configuration: &Configuration) {
        let Some(directory) = configuration.store() else { return };
        let models = Store::at(&directory).train(train);
        // Models written down before the recording do not belong to it.
        let known = newest(&models);
        self.trains.entry(train).or_insert((models, known));
    }

    /// Returns the events since the last call; at most once every few seconds.
    pub fn news(&mut self) -> Vec<Event> {
        if self.looked.is_some_and(|looked| looked.elapsed() < EVERY) {
            return Vec::new();
        }
        self.looked = Some(Instant::now());
        let mut news = Vec::new();
        for (train, (models, known)) in &mut self.trains {
            // One that cannot be read is reported by those who work on the store.
            let events = models.events().unwrap_or_default();
            for (number, found) in events.iter().filter(|(number, _)| number > known) {
                let text = format!("maintenance event {number}: {}", found.sentence);
                news.push(Event::now(*train, EventKind::MaintenanceFound, text));
            }
            *known = events.last().map_or(*known, |(number, _)| *number);
        }
        news
    }
}

fn newest(models: &TrainModels) -> u64 {
    let events = models.events().unwrap_or_default();
    events.last().map_or(0, |(number, _)| *number)
}
