//! Attachments: the daemon's configuration with its files, and maintenance events as they come.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use dynocar::dataset::read_text;
use dynocar::models::{ModelText, Store, TrainModels};
use dynocar_shared::TrainId;
use toml::Table;

use dynocar_mcap::event::{Event, EventKind};

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
