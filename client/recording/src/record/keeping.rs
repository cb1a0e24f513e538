//! What a flight recorder keeps for good: the files around a moment, under names of their own.
//!
//! A file is kept by giving it a second name (a hard link) in the folder of the stretch. So it is kept from
//! that moment on, whatever happens to the recorder: the ring removes only the first name, and the file that
//! is being written goes on growing under both.

use std::collections::HashMap;
use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use dynocar::models::moment::Moment;
use dynocar::output::{OutputError, tell, write_file};
use dynocar_shared::Status;
use serde::{Deserialize, Serialize};

use crate::event::{Event, EventKind};

/// Beside the ring: what is kept.
const KEPT_FOLDER: &str = "kept";
/// In the folder of a stretch: why it is kept.
const STRETCH_FILE: &str = "stretch.toml";
/// In the ring's folder: that this moment is to be kept, and why.
const REQUEST_FILE: &str = "keep.request";
/// In the ring's folder: held by the recorder that writes there.
const LOCK_FILE: &str = "recorder.lock";

/// How much is kept around a moment, and in all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Keeping {
    /// Before the moment.
    pub before: Duration,
    /// After it.
    pub after: Duration,
    /// The most bytes that all that is kept takes, but for one file.
    pub most_bytes: u64,
}

/// Why something is not kept. It stops nothing.
#[derive(Debug, thiserror::Error)]
pub enum KeepError {
    /// What is kept takes all that it may.
    #[error("nothing is kept for good: {}: takes its {most_mib} MiB already: move stretches away", kept.display())]
    Full {
        /// Where it lies.
        kept: PathBuf,
        /// What it may take.
        most_mib: u64,
    },
    /// The ring is another recorder's.
    #[error("{}: another recorder writes into this ring", ring.display())]
    Taken {
        /// The ring's folder.
        ring: PathBuf,
    },
    /// The system refuses.
    #[error("nothing is kept for good: {}: {source}", path.display())]
    System {
        /// The file or folder.
        path: PathBuf,
        /// Its answer.
        source: io::Error,
    },
    /// The account of the stretch is not written.
    #[error(transparent)]
    Account(#[from] OutputError),
}

/// Keeps what lies around a moment.
#[derive(Debug)]
pub struct Keeper {
    ring: PathBuf,
    keeping: Keeping,
    /// The newest stretch, which goes on until its end.
    open: Option<(PathBuf, Stretch)>,
    is_full_told: bool,
    /// No other recorder writes here.
    _lock: File,
}

/// Why and until when a stretch is kept.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Stretch {
    /// Files that are begun before belong to it, in s since 1970.
    until_unix_s: u64,
    reasons: Vec<Reason>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Reason {
    at: String,
    train: u64,
    kind: String,
    text: String,
}

/// True for an event around which a flight recorder keeps what it has: a suspicion, a fault, a request.
pub fn is_reason(event: &Event) -> bool {
    match EventKind::try_from(event.kind) {
        Ok(
            EventKind::SuspicionRaised
            | EventKind::KeepRequested
            | EventKind::DaemonSilent
            | EventKind::DaemonGone
            | EventKind::SamplesLost,
        ) => true,
        Ok(EventKind::StatusChanged) => event.status == Some(Status::Invalid as i32),
        _ => false,
    }
}

/// Asks the recorder that writes into a ring to keep this moment; false when there is none.
///
/// # Errors
///
/// When the folder is none, or the request cannot be written.
pub fn request(ring: &Path, reason: &str) -> io::Result<bool> {
    let lock = File::open(ring.join(LOCK_FILE));
    match lock.map(|file| file.try_lock_shared()) {
        Ok(Err(TryLockError::WouldBlock)) => {}
        Ok(Err(TryLockError::Error(error))) => return Err(error),
        Ok(Ok(())) => return Ok(false),
        Err(error) if error.kind() == ErrorKind::NotFound && ring.is_dir() => return Ok(false),
        Err(error) => return Err(error),
    }
    let request = ring.join(REQUEST_FILE);
    write_file(&request, reason).map_err(|error| io::Error::other(error.to_string()))?;
    Ok(true)
}

impl Keeper {
    /// Takes a ring's folder, which is made where it is not there. A stretch that another recorder has left
    /// open goes on.
    ///
    /// # Errors
    ///
    /// When another recorder writes there, or the folder cannot be made.
    pub fn begin(ring: &Path, keeping: Keeping) -> Result<Self, KeepError> {
        fs::create_dir_all(ring.join(KEPT_FOLDER)).map_err(refused(ring))?;
        let lock = File::options().create(true).append(true).open(ring.join(LOCK_FILE));
        let lock = lock.map_err(refused(ring))?;
        lock.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => KeepError::Taken { ring: ring.into() },
            TryLockError::Error(error) => refused(ring)(error),
        })?;
        let open = newest_stretch(&ring.join(KEPT_FOLDER));
        Ok(Keeper { ring: ring.into(), keeping, open, is_full_told: false, _lock: lock })
    }

    /// The request that was made since the last look, in words.
    pub fn request(&self) -> Option<String> {
        let path = self.ring.join(REQUEST_FILE);
        let text = fs::read_to_string(&path).ok()?;
        // One that cannot be removed would ask again and again.
        fs::remove_file(&path).ok()?;
        Some(text.trim().to_owned())
    }

    /// Keeps the files that reach back from now by no more than is kept before a moment; `files` are all of
    /// the ring, the oldest first.
    ///
    /// # Errors
    ///
    /// When a file cannot be kept.
    pub fn keep(&mut self, event: &Event, files: &[PathBuf]) -> Result<(), KeepError> {
        let now = SystemTime::now();
        let reason = reason(event, now);
        let (folder, mut stretch) = match self.open.take().filter(|it| it.1.is_open(now)) {
            Some(open) => open,
            None => (self.new_folder(&reason), Stretch::default()),
        };
        fs::create_dir_all(&folder).map_err(refused(&folder))?;
        let is_news = stretch.reasons.last().is_none_or(|last| !last.is_like(&reason));
        stretch.until_unix_s = unix_s(now + self.keeping.after);
        if is_news {
            tell(&format!(
                "kept for good: {}: {} ({})",
                folder.display(),
                reason.kind,
                reason.text
            ));
            stretch.reasons.push(reason);
        }
        let kept = stretch.write(&folder).and_then(|()| {
            let from = now.checked_sub(self.keeping.before).unwrap_or(UNIX_EPOCH);
            let is_near = |path: &&PathBuf| {
                let modified = fs::metadata(path).and_then(|it| it.modified());
                modified.is_ok_and(|it| it >= from)
            };
            // The newest is being written, whenever that was last.
            let newest = files.last().into_iter();
            files.iter().filter(is_near).chain(newest).try_for_each(|it| self.link(it, &folder))
        });
        self.open = Some((folder, stretch));
        kept
    }

    /// A new file was begun, the last of these: it belongs to a stretch that is not yet at its end.
    ///
    /// # Errors
    ///
    /// When it cannot be kept.
    pub fn begun(&mut self, files: &[PathBuf]) -> Result<(), KeepError> {
        let open = self.open.take().filter(|it| it.1.is_open(SystemTime::now()));
        let kept = match (&open, files.last()) {
            (Some((folder, _)), Some(newest)) => {
                let folder = folder.clone();
                self.link(newest, &folder)
            }
            _ => Ok(()),
        };
        self.open = open;
        kept
    }

    fn new_folder(&self, reason: &Reason) -> PathBuf {
        let kept = self.ring.join(KEPT_FOLDER);
        let name = format!("{}_{}", reason.at.replace(':', "-"), reason.kind);
        let names = std::iter::once(name.clone()).chain((2..).map(|it| format!("{name}_{it}")));
        let mut free = names.map(|it| kept.join(it)).filter(|it| !it.exists());
        free.next().unwrap_or_else(|| kept.join(&name))
    }

    fn link(&mut self, file: &Path, folder: &Path) -> Result<(), KeepError> {
        let Some(name) = file.file_name() else { return Ok(()) };
        let to = folder.join(name);
        if to.exists() {
            return Ok(());
        }
        let length = fs::metadata(file).map_or(0, |it| it.len());
        let most = self.keeping.most_bytes;
        if kept_bytes(&self.ring.join(KEPT_FOLDER)) + length > most {
            if std::mem::replace(&mut self.is_full_told, true) {
                return Ok(());
            }
            let kept = self.ring.join(KEPT_FOLDER);
            return Err(KeepError::Full { kept, most_mib: most >> 20 });
        }
        self.is_full_told = false;
        fs::hard_link(file, &to).map_err(refused(&to))
    }
}

impl Stretch {
    fn is_open(&self, now: SystemTime) -> bool {
        unix_s(now) <= self.until_unix_s
    }

    fn write(&self, folder: &Path) -> Result<(), KeepError> {
        // Numbers and texts always have a text in TOML.
        let text = toml::to_string(self).unwrap_or_default();
        Ok(write_file(&folder.join(STRETCH_FILE), &text)?)
    }
}

impl Reason {
    /// True for the same over again, whose words differ at most by a number.
    fn is_like(&self, other: &Reason) -> bool {
        (self.train, &self.kind) == (other.train, &other.kind)
            && (self.text == other.text || self.kind == EventKind::SamplesLost.name())
    }
}

fn reason(event: &Event, now: SystemTime) -> Reason {
    let kind = EventKind::try_from(event.kind).unwrap_or(EventKind::Unknown);
    Reason {
        at: Moment::of(now).to_string(),
        train: event.train_id,
        kind: kind.name().to_owned(),
        text: event.text.clone(),
    }
}

fn unix_s(at: SystemTime) -> u64 {
    at.duration_since(UNIX_EPOCH).map_or(0, |it| it.as_secs())
}

fn refused(path: &Path) -> impl FnOnce(io::Error) -> KeepError {
    move |source| KeepError::System { path: path.into(), source }
}

/// The stretch with the latest end, by what its folder says.
fn newest_stretch(kept: &Path) -> Option<(PathBuf, Stretch)> {
    let folders = fs::read_dir(kept).ok()?.flatten().map(|it| it.path());
    let known = folders.filter_map(|folder| {
        let text = fs::read_to_string(folder.join(STRETCH_FILE)).ok()?;
        Some((folder, toml::from_str::<Stretch>(&text).ok()?))
    });
    known.max_by_key(|it| it.1.until_unix_s)
}

/// Bytes of all files that are kept, each once.
fn kept_bytes(kept: &Path) -> u64 {
    let folders = fs::read_dir(kept).into_iter().flatten().flatten();
    let files = folders.filter_map(|it| fs::read_dir(it.path()).ok()).flatten().flatten();
    let known = files.filter_map(|it| it.metadata().ok()).map(|it| (it.ino(), it.len()));
    known.collect::<HashMap<u64, u64>>().values().sum()
}
