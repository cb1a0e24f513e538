//! Care of a recorder's files in addition to writing: bringing them to the disk, keeping them, and removing those that
//! the ring no longer holds.
//!
//! A disk may take seconds for each of these tasks. They are done in the order of the requests, in a thread of their
//! own while a recorder runs, so that recording never waits for them.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use dynocar::output::report_line;
use dynocar::storage::{SharedStorage, Storage, settle};

use super::keeping::{EventKeeper, KeepError};
use super::ring::{Aged, Ages};
use dynocar_mcap::event::Event;

/// A task of the housekeeping.
#[derive(Debug)]
pub enum Task {
    /// Bring a file with this many new items to the disk, together with the files before it.
    Settle {
        /// The file.
        file: PathBuf,
        /// Samples, snapshots and events.
        items: u64,
    },
    /// A file was begun: it belongs to an event that is not yet at its end.
    Begun {
        /// The file.
        file: PathBuf,
    },
    /// Keep the files around an event.
    Keep {
        /// The reason.
        event: Event,
    },
    /// Remove the files that are too old or too many, but never this one.
    RemoveOldest {
        /// The file that is written.
        written: PathBuf,
    },
}

/// How far the disk has come.
#[derive(Debug, Default)]
struct Progress {
    /// Items that no power cut takes any more.
    lasting: AtomicU64,
    /// True while a file waits to be brought to the disk.
    is_settling: AtomicBool,
}

/// A task that failed: it does not stop a recording.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be brought to the disk: {source}; a power cut may take what was recorded since", file.display())]
struct SettleError {
    file: PathBuf,
    source: std::io::Error,
}

/// Does it.
struct Housekeeping {
    storage: SharedStorage,
    output: PathBuf,
    rotation: Rotation,
    keeper: Option<EventKeeper>,
    ages: Ages,
    progress: Arc<Progress>,
    /// The file whose name is on the disk.
    named: PathBuf,
    is_failure_reported: bool,
}

impl Housekeeping {
    fn take(&mut self, task: Task) {
        match task {
            Task::Settle { file, items } => {
                match self.settle(&file) {
                    Ok(()) => {
                        self.progress.lasting.store(items, Ordering::Release);
                        self.is_failure_reported = false;
                    }
                    Err(source) if !std::mem::replace(&mut self.is_failure_reported, true) => {
                        report_line(&SettleError { file, source }.to_string());
                    }
                    Err(_) => {}
                }
                self.progress.is_settling.store(false, Ordering::Release);
            }
            Task::Begun { file } => {
                self.ages.note_ended(&self.output, &file);
                self.keep(|keeper, _| keeper.begun(&file));
            }
            Task::Keep { event } => self.keep(|keeper, files| keeper.keep(&event, files)),
            Task::RemoveOldest { written } => {
                let files = self.ages.of_files(&self.output);
                remove_oldest(&*self.storage, &files, &written, self.rotation);
            }
        }
    }

    fn settle(&mut self, file: &Path) -> std::io::Result<()> {
        if self.named == file {
            return self.storage.sync_file(file);
        }
        settle(&*self.storage, file)?;
        self.named = file.into();
        Ok(())
    }

    /// A problem of keeping is reported, and stops nothing.
    fn keep(&mut self, work: impl FnOnce(&mut EventKeeper, &[Aged]) -> Result<(), KeepError>) {
        let Some(keeper) = &mut self.keeper else { return };
        let files = self.ages.of_files(&self.output);
        if let Err(problem) = work(keeper, &files) {
            report_line(&problem.to_string());
        }
    }
}

/// Where it is done.
enum HousekeepingThread {
    /// At once, in the thread of the caller.
    Here(Box<Housekeeping>),
    /// In a thread of its own, which ends when nobody can ask any more.
    Running(Sender<Task>, JoinHandle<()>),
}

/// Has things done with the files of a recording.
pub struct Housekeeper {
    place: HousekeepingThread,
    progress: Arc<Progress>,
}

impl Housekeeper {
    /// Does everything at once; with a keeper, keeps.
    pub fn new(
        storage: SharedStorage,
        output: &Path,
        rotation: Rotation,
        keeper: Option<EventKeeper>,
    ) -> Self {
        let progress = Arc::<Progress>::default();
        let housekeeping = Housekeeping {
            storage,
            output: output.into(),
            rotation,
            keeper,
            ages: Ages::from_existing(output, rotation.age),
            progress: Arc::clone(&progress),
            named: PathBuf::new(),
            is_failure_reported: false,
        };
        Housekeeper { place: HousekeepingThread::Here(Box::new(housekeeping)), progress }
    }

    /// Does everything in a thread of its own from now on.
    ///
    /// # Errors
    ///
    /// When the system gives no thread.
    pub fn in_parallel(self) -> std::io::Result<Self> {
        let mut housekeeping = match self.place {
            HousekeepingThread::Here(housekeeping) => housekeeping,
            HousekeepingThread::Running(..) => return Ok(self),
        };
        let (tasks, asked) = channel();
        let thread = std::thread::Builder::new().name("housekeeping".into());
        let thread = thread.spawn(move || asked.iter().for_each(|it| housekeeping.take(it)))?;
        let place = HousekeepingThread::Running(tasks, thread);
        Ok(Housekeeper { place, progress: self.progress })
    }

    /// Asks for something.
    pub fn ask(&mut self, task: Task) {
        if matches!(task, Task::Settle { .. }) {
            self.progress.is_settling.store(true, Ordering::Release);
        }
        match &mut self.place {
            HousekeepingThread::Here(housekeeping) => housekeeping.take(task),
            // The thread ends after the sender only.
            HousekeepingThread::Running(tasks, _) => drop(tasks.send(task)),
        }
    }

    /// Returns whether a file waits to be brought to the disk: it need not be asked for again.
    pub fn is_settling(&self) -> bool {
        self.progress.is_settling.load(Ordering::Acquire)
    }

    /// Returns the samples, snapshots and events that no power cut takes any more.
    pub fn lasting(&self) -> u64 {
        self.progress.lasting.load(Ordering::Acquire)
    }

    /// Ends when everything is done.
    pub fn finish(self) {
        if let HousekeepingThread::Running(tasks, thread) = self.place {
            drop(tasks);
            // A thread that panicked has reported so.
            let _ = thread.join();
        }
    }
}

/// When a file is full, and how much of them is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rotation {
    /// Bytes after which a new file is begun.
    pub bytes: Option<u64>,
    /// Time after which a new file is begun.
    pub age: Option<Duration>,
    /// The most bytes that all files of the recording take; the oldest are removed.
    pub keep_bytes: Option<u64>,
    /// The age after which a file is removed.
    pub keep_age: Option<Duration>,
}

impl Rotation {
    /// Returns whether new files are begun at all.
    pub fn is_on(self) -> bool {
        self.bytes.is_some() || self.age.is_some()
    }
}

/// Removes the files that are too old, and the oldest until the rest takes no more than it may; never the
/// one that is written.
pub fn remove_oldest(storage: &dyn Storage, files: &[Aged], written: &Path, rotation: Rotation) {
    let most = rotation.keep_bytes.unwrap_or(u64::MAX);
    let length_of = |path: &Path| std::fs::metadata(path).map_or(0, |it| it.len());
    let mut total: u64 = files.iter().map(|it| length_of(&it.path)).sum();
    for Aged { path, age } in files.iter().filter(|it| it.path != written) {
        let is_too_old = rotation.keep_age.is_some_and(|most| *age > most);
        if total > most || is_too_old {
            total -= length_of(path);
            // One that cannot be removed is reported when the disk is full.
            let _ = storage.remove(path);
        }
    }
}
