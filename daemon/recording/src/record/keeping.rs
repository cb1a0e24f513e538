//! Files that a flight recorder keeps for good: those around a moment, under names of their own.
//!
//! A file is kept by giving it a second name (a hard link) in the folder of the event. It is kept from that moment on,
//! even if the recorder dies: the ring removes only the first name, and the file that is being written grows under
//! both. An event takes its name when its files and their names are on the disk, so that a power cut leaves it whole or
//! not at all.

use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use dynocar::output::{report_line, write_file};
use dynocar::stamp::Stamp;
use dynocar::storage::{SharedStorage, StorageError};
use dynocar_shared::Status;

use super::ring::{Aged, KeptEvent, Reason, beside, forget_unfinished, kept_bytes, newest_event};
use dynocar_mcap::event::{Event, EventKind};

/// Folder in the ring's folder for the kept files.
const KEPT_FOLDER: &str = "kept";
/// File in the ring's folder that requests to keep this moment, with the reason.
const REQUEST_FILE: &str = "keep.request";
/// File in the ring's folder that the recorder writing there holds locked.
const LOCK_FILE: &str = "recorder.lock";

/// How much is kept around a moment, and altogether.
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
    /// The kept files take all the space that they may.
    #[error("nothing is kept for good: {}: takes its {most_mib} MiB already: move events away", kept.display())]
    Full {
        /// Where it lies.
        kept: PathBuf,
        /// Most space that they may take.
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
}

impl From<StorageError> for KeepError {
    fn from(StorageError { path, source, .. }: StorageError) -> Self {
        KeepError::System { path, source }
    }
}

/// Keeps the files around a moment.
pub struct EventKeeper {
    storage: SharedStorage,
    ring: PathBuf,
    keeping: Keeping,
    /// The newest event, which goes on until its end.
    open: Option<(PathBuf, KeptEvent)>,
    /// When that is, by the clock that nobody sets.
    until: Instant,
    is_full_reported: bool,
    /// No other recorder writes here.
    _lock: File,
}

impl std::fmt::Debug for EventKeeper {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Keeper")
            .field("ring", &self.ring)
            .field("open", &self.open)
            .finish_non_exhaustive()
    }
}

/// Returns true for an event around which a flight recorder keeps its files: a suspicion, a fault, a request.
pub fn is_reason(event: &Event) -> bool {
    match event.kind() {
        EventKind::SuspicionRaised
        | EventKind::KeepRequested
        | EventKind::DaemonSilent
        | EventKind::DaemonGone
        | EventKind::SamplesLost => true,
        EventKind::StatusChanged => event.status == Some(Status::Invalid as i32),
        _ => false,
    }
}

/// Returns the request that was made in a ring's folder since the last look, in words.
pub fn requested(ring: &Path) -> Option<String> {
    let path = ring.join(REQUEST_FILE);
    let text = fs::read_to_string(&path).ok()?;
    // One that cannot be removed would ask again and again.
    fs::remove_file(&path).ok()?;
    Some(text.trim().to_owned())
}

/// Asks the recorder that writes into a ring to keep this moment; false when there is none.
///
/// # Errors
///
/// If the folder is not a ring, or the request cannot be written.
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

impl EventKeeper {
    /// Takes a ring's folder, which is made where it is not there. An event that another recorder has left
    /// open goes on.
    ///
    /// # Errors
    ///
    /// When another recorder writes there, or the folder cannot be made.
    pub fn begin(storage: SharedStorage, ring: &Path, keeping: Keeping) -> Result<Self, KeepError> {
        storage.make_folder(&ring.join(KEPT_FOLDER)).map_err(refused(ring))?;
        let lock = File::options().create(true).append(true).open(ring.join(LOCK_FILE));
        let lock = lock.map_err(refused(ring))?;
        lock.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => KeepError::Taken { ring: ring.into() },
            TryLockError::Error(error) => refused(ring)(error),
        })?;
        forget_unfinished(&ring.join(KEPT_FOLDER));
        let open = newest_event(&ring.join(KEPT_FOLDER));
        // By its account, but never later than if it had begun now.
        let left_s = open.as_ref().map_or(0.0, |it| Stamp::now().seconds_to(&it.1.until()));
        let left = Duration::try_from_secs_f64(left_s).unwrap_or_default().min(keeping.after);
        let until = Instant::now() + left;
        let open = open.filter(|_| !left.is_zero());
        Ok(EventKeeper {
            storage,
            ring: ring.into(),
            keeping,
            open,
            until,
            is_full_reported: false,
            _lock: lock,
        })
    }

    /// Keeps the files that reach back by no more than is kept before a moment; `files` are all of the ring,
    /// the oldest first.
    ///
    /// # Errors
    ///
    /// When a file cannot be kept.
    pub fn keep(&mut self, event: &Event, files: &[Aged]) -> Result<(), KeepError> {
        let reason = Reason::new(event, SystemTime::now());
        let open = self.take_open();
        let is_new = open.is_none();
        let (folder, mut event) =
            open.unwrap_or_else(|| (self.new_folder(&reason), KeptEvent::default()));
        let is_news = event.reasons.last().is_none_or(|last| !last.is_like(&reason));
        let line =
            format!("kept for good: {}: {} ({})", folder.display(), reason.kind, reason.text);
        if is_news {
            event.reasons.push(reason);
        }
        self.until = Instant::now() + self.keeping.after;
        let is_longer = event.end_at(Stamp::now().after_s(self.keeping.after.as_secs_f64()));
        let kept = match is_new {
            true => self.make(&folder, &event, &self.near(files)),
            false if is_news || is_longer => Ok(event.write(&self.storage, &folder)?),
            false => Ok(()),
        };
        if is_news && kept.is_ok() {
            report_line(&line);
        }
        // One that was not made is not there to go on with.
        self.open = (folder.exists()).then_some((folder, event));
        kept
    }

    /// Returns the newest event, unless it is at its end.
    fn take_open(&mut self) -> Option<(PathBuf, KeptEvent)> {
        self.open.take().filter(|_| Instant::now() < self.until)
    }

    /// Returns the files that reach back by no more than is kept before a moment, and the newest: it is being written,
    /// whenever that was last.
    fn near(&self, files: &[Aged]) -> Vec<PathBuf> {
        let newest = files.len().saturating_sub(1);
        let is_near = |it: &(usize, &Aged)| it.0 == newest || it.1.age <= self.keeping.before;
        files.iter().enumerate().filter(is_near).map(|it| it.1.path.clone()).collect()
    }

    /// Makes an event: it takes its name when all of it is on the disk.
    fn make(
        &mut self,
        folder: &Path,
        event: &KeptEvent,
        files: &[PathBuf],
    ) -> Result<(), KeepError> {
        let beside = beside(folder);
        self.storage.make_folder(&beside).map_err(refused(&beside))?;
        let linked = files.iter().try_for_each(|file| {
            self.link(file, &beside)?;
            self.storage.sync_file(file).map_err(refused(file))
        });
        // The files that could be kept are kept, even if others could not.
        event.write(&self.storage, &beside)?;
        self.storage.rename_new(&beside, folder).map_err(refused(folder))?;
        let kept = self.ring.join(KEPT_FOLDER);
        self.storage.sync_directory(&kept).map_err(refused(&kept))?;
        linked
    }

    /// A new file was begun: it belongs to an event that is not yet at its end.
    ///
    /// # Errors
    ///
    /// When it cannot be kept.
    pub fn begun(&mut self, file: &Path) -> Result<(), KeepError> {
        self.open = self.take_open();
        let Some((folder, _)) = &self.open else { return Ok(()) };
        let folder = folder.clone();
        self.link(file, &folder)?;
        self.storage.sync_directory(&folder).map_err(refused(&folder))
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
            if std::mem::replace(&mut self.is_full_reported, true) {
                return Ok(());
            }
            let kept = self.ring.join(KEPT_FOLDER);
            return Err(KeepError::Full { kept, most_mib: most >> 20 });
        }
        self.is_full_reported = false;
        self.storage.link(file, &to).map_err(refused(&to))
    }
}

fn refused(path: &Path) -> impl FnOnce(io::Error) -> KeepError {
    move |source| KeepError::System { path: path.into(), source }
}
