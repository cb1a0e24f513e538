//! The files of a ring by their numbers, and an event that is kept: its folder, and the record of the reasons.

use std::collections::HashMap;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use dynocar::stamp::{SinceBoot, Stamp, UtcSecond};
use dynocar::storage::{Rights, SharedStorage, StorageError, replace};
use dynocar_mcap::event::{Event, EventKind};
use serde::{Deserialize, Serialize};

/// File in the folder of an event with the reasons for keeping it.
const EVENT_FILE: &str = "stretch.toml";

/// Why and until when an event is kept.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KeptEvent {
    /// Files that are begun before this moment belong to the event, in whole s since 1970.
    until_unix_s: u64,
    /// The reasons.
    #[serde(default)]
    pub reasons: Vec<Reason>,
    /// The same moment by the clock that nobody sets.
    until_since_boot: Option<SinceBoot>,
}

/// One reason to keep.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reason {
    /// When.
    pub at: String,
    /// Which train, 0 for none.
    pub train: u64,
    /// The event's kind.
    pub kind: String,
    /// Text of the event.
    pub text: String,
}

impl KeptEvent {
    /// Sets its end; true when that is a second later than before.
    pub fn end_at(&mut self, until: Stamp) -> bool {
        let is_longer = self.until().seconds_to(&until) >= 1.0;
        self.until_unix_s = until.unix_s as u64;
        self.until_since_boot = until.since_boot;
        is_longer
    }

    /// Returns its end.
    pub fn until(&self) -> Stamp {
        let since_boot = self.until_since_boot.clone();
        Stamp { unix_s: self.until_unix_s as f64, since_boot }
    }

    /// Brings the account to the disk, with all names in the folder.
    ///
    /// # Errors
    ///
    /// The system's answer.
    pub fn write(&self, storage: &SharedStorage, folder: &Path) -> Result<(), StorageError> {
        // Numbers and texts always have a text in TOML.
        let text = toml::to_string(self).unwrap_or_default();
        let path = folder.join(EVENT_FILE);
        replace(&**storage, &path, &beside(&path), (text.as_bytes(), &Rights::Usual))
    }
}

impl Reason {
    /// Returns the reason that an event is.
    pub fn new(event: &Event, now: SystemTime) -> Self {
        Reason {
            at: UtcSecond::from_time(now).to_string(),
            train: event.train_id,
            kind: event.kind().name().to_owned(),
            text: event.text.clone(),
        }
    }

    /// Returns true for the same over again, whose words differ at most by a number.
    pub fn is_like(&self, other: &Reason) -> bool {
        (self.train, &self.kind) == (other.train, &other.kind)
            && (self.text == other.text || self.kind == EventKind::SamplesLost.name())
    }
}

/// Returns the name under which an event or an account comes into being: a ring has one keeper.
pub fn beside(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.part"))
}

/// Removes the folders that a recorder that died did not finish: their files still have names in the ring.
pub fn forget_unfinished(kept: &Path) {
    let folders = fs::read_dir(kept).into_iter().flatten().flatten().map(|it| it.path());
    let is_unfinished = |path: &PathBuf| {
        let name = path.file_name().and_then(|it| it.to_str()).unwrap_or("");
        name.starts_with('.') && name.ends_with(".part")
    };
    for folder in folders.filter(is_unfinished) {
        // One that stays takes room, and nothing else.
        let _ = fs::remove_dir_all(folder);
    }
}

/// Returns the event that ends last, according to the record in its folder.
pub fn newest_event(kept: &Path) -> Option<(PathBuf, KeptEvent)> {
    let now = Stamp::now();
    let folders = fs::read_dir(kept).ok()?.flatten().map(|it| it.path());
    let known = folders.filter_map(|folder| {
        let text = fs::read_to_string(folder.join(EVENT_FILE)).ok()?;
        Some((folder, toml::from_str::<KeptEvent>(&text).ok()?))
    });
    let left_s = |it: &(PathBuf, KeptEvent)| now.seconds_to(&it.1.until());
    known.max_by(|one, other| left_s(one).total_cmp(&left_s(other)))
}

/// Bytes of all files that are kept, each once.
pub fn kept_bytes(kept: &Path) -> u64 {
    let folders = fs::read_dir(kept).into_iter().flatten().flatten();
    let files = folders.filter_map(|it| fs::read_dir(it.path()).ok()).flatten().flatten();
    let known = files.filter_map(|it| it.metadata().ok()).map(|it| (it.ino(), it.len()));
    known.collect::<HashMap<u64, u64>>().values().sum()
}

/// A file of the ring.
#[derive(Clone, Debug)]
pub struct Aged {
    /// Path of the file.
    pub path: PathBuf,
    /// Time since it ended; zero for the file that is being written.
    pub age: Duration,
}

/// How old an ended file was at a moment.
#[derive(Clone, Copy, Debug)]
struct Ended {
    age: Duration,
    at: Instant,
}

/// The ages of a ring's files.
#[derive(Debug)]
pub struct Ages {
    ended: HashMap<PathBuf, Ended>,
}

impl Ages {
    /// Returns the files that a recorder finds when it begins; none took longer than `part`, where that is known.
    pub fn from_existing(output: &Path, part: Option<Duration>) -> Self {
        let (at, mut age) = (Instant::now(), Duration::ZERO);
        let (mut ended, mut later) = (HashMap::new(), None::<SystemTime>);
        for (_, path) in numbered(output).into_iter().rev() {
            let Ok(date) = std::fs::metadata(&path).and_then(|it| it.modified()) else { continue };
            let gap = later.and_then(|it| it.duration_since(date).ok()).unwrap_or_default();
            age += gap.min(part.unwrap_or(gap));
            later = Some(date);
            ended.insert(path, Ended { age, at });
        }
        Ages { ended }
    }

    /// A file was begun: those before it have ended.
    pub fn note_ended(&mut self, output: &Path, begun: &Path) {
        let at = Instant::now();
        let files = numbered(output);
        self.ended.retain(|path, _| files.iter().any(|it| it.1 == *path));
        for (_, path) in files.into_iter().filter(|it| it.1 != begun) {
            self.ended.entry(path).or_insert(Ended { age: Duration::ZERO, at });
        }
    }

    /// Returns all files, the oldest first: none is younger than one after it.
    pub fn of_files(&self, output: &Path) -> Vec<Aged> {
        let mut least = Duration::ZERO;
        let files = numbered(output).into_iter().rev().map(|(_, path)| {
            let age = self.ended.get(&path).map(|it| it.age + it.at.elapsed());
            least = least.max(age.unwrap_or_default());
            Aged { path, age: least }
        });
        let mut files: Vec<Aged> = files.collect();
        files.reverse();
        files
    }
}

/// Returns the files of a rotating recording with their numbers, the oldest first.
pub fn numbered(output: &Path) -> Vec<(u64, PathBuf)> {
    let stem = output.file_stem().unwrap_or_default().to_string_lossy().into_owned() + "-";
    let number_of = |path: &Path| {
        let name = path.file_name()?.to_str()?.strip_prefix(&stem)?.strip_suffix(".mcap")?;
        (name.len() == DIGITS).then(|| name.parse().ok())?
    };
    let folder = dynocar::storage::folder_of(output);
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<(u64, PathBuf)> =
        entries.filter_map(|it| Some((number_of(&it.path())?, it.path()))).collect();
    files.sort();
    files
}

/// Digits of a file's number.
const DIGITS: usize = 6;

/// Returns the name of the next file: `run-000007.mcap` for `run.mcap`.
pub fn next(output: &Path) -> PathBuf {
    let number = numbered(output).last().map_or(1, |newest| newest.0 + 1);
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    output.with_file_name(format!("{stem}-{number:0DIGITS$}.mcap"))
}
