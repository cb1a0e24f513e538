//! An event that is kept: its folder, and the record of the reasons.

use std::collections::HashMap;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use dynocar::stamp::{SinceBoot, Stamp, UtcSecond};
use dynocar::storage::{Rights, SharedStorage, StorageError, replace};
use serde::{Deserialize, Serialize};

use dynocar_mcap::event::{Event, EventKind};

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
pub fn newest(kept: &Path) -> Option<(PathBuf, KeptEvent)> {
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
