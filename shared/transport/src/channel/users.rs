//! The users of the transport of a run-time directory, counted so that the last one can tidy up.
//!
//! The transport keeps one small segment for each run-time directory for good (it numbers the nodes), open to every
//! user of the host. Here the segment is closed to others, and removed by the last process that leaves. Every port
//! holds a shared lock on the root directory, which also keeps systemd-tmpfiles out of it. A process that gets an
//! exclusive lock is alone, and no other can enter until it releases the lock. A process that enters alone removes the
//! files of processes that were killed; while others are there, the next process that makes a service or a port removes
//! incomplete ones.

use std::fs::{OpenOptions, Permissions, TryLockError};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use iceoryx2::node::NodeState;
use iceoryx2::prelude::{CallbackProgression, Node, ipc};
use rustix::fs::{Access, FallocateFlags, access};
use rustix::io::Errno;

use crate::announcement::SHARED_MEMORY;
use crate::channel::process::LockedFile;
use crate::error::ChannelError;
use crate::host::{Host, open_private, unusable};

/// Ending of the segment's name.
const SUFFIX: &str = ".global_mgmt";
/// Ending of the names of the segments between a sender and a receiver.
const CONNECTION_SUFFIX: &str = ".connection";
/// Ending of the names of the pages that count samples, see [`super::SampleCount`].
pub const COUNT_SUFFIX: &str = ".count";
/// The modes of a service's description and of a segment that are not complete: the transport's.
const DESCRIPTION_IN_MAKING: u32 = 0o600;
const SEGMENT_IN_MAKING: u32 = 0o200;
/// Memory that a few ports take with their services and connections, with a margin.
const FREE_BYTES_MIN: u64 = 4 << 20;
const FREE_FILES_MIN: u64 = 32;
/// Longest wait for a lock, and the pause between two tries: a daemon of many trains, which makes hundreds of ports one
/// after another, lets others in between.
const LOCK_TIME: Duration = Duration::from_secs(5);
const PAUSE: Duration = Duration::from_millis(2);
/// Time after which who makes or removes something is done with it, or dead.
const MADE_TIME: Duration = Duration::from_millis(20);

/// A user of the transport, until dropped.
#[derive(Debug)]
pub struct Users {
    lock: LockedFile,
    making: PathBuf,
    host: Host,
    segment_prefix: String,
    has_made: AtomicBool,
}

/// The making of something, until dropped. The file is empty while nothing is being made.
#[derive(Debug)]
pub struct Making(LockedFile);

impl Drop for Making {
    fn drop(&mut self) {
        if let Some(file) = self.0.own() {
            // Otherwise the next one looks for incomplete files, and finds none.
            let _ = file.set_len(0);
        }
    }
}

impl Users {
    /// Enters a run-time directory.
    ///
    /// # Errors
    ///
    /// When the lock cannot be had.
    pub fn enter(host: &Host) -> Result<Self, ChannelError> {
        let users = Users {
            lock: LockedFile::new(host.open_root()?),
            making: host.root().join("services.lock"),
            host: host.clone(),
            segment_prefix: host.segment_prefix(),
            has_made: AtomicBool::new(false),
        };
        if users.lock.try_lock().is_ok() && !users.has_strangers() {
            users.remove_all();
        }
        // An exclusive lock becomes a shared one; another newcomer may come between, and finds nothing.
        wait_for(host.root(), || users.lock.try_lock_shared())?;
        Ok(users)
    }

    /// Begins the making of a node, a service or a port, which one process does at a time.
    ///
    /// Removes the incomplete files of processes that were killed: where the one before was killed at it, at the first
    /// call, and where the transport has refused something (`is_refused`), since leaving removes services too.
    ///
    /// # Errors
    ///
    /// When the lock cannot be had.
    pub fn begin_making(&self, is_refused: bool) -> Result<Making, ChannelError> {
        let file = open_private(&self.making).map_err(unusable(&self.making, "opening"))?;
        let file = LockedFile::new(file);
        wait_for(&self.making, || file.try_lock())?;
        let marked = file.metadata().and_then(|it| file.set_len(1).map(|()| it.len() > 0));
        let was_killed = marked.map_err(unusable(&self.making, "marking"))?;
        let is_first = !self.has_made.swap(true, Relaxed);
        if is_first || is_refused || was_killed {
            self.remove_half_made();
        }
        Ok(Making(file))
    }

    /// Removes the files of dead processes, where no process lives; the count of samples stays.
    fn remove_all(&self) {
        for segment in self.segments(&[""]) {
            if segment.to_string_lossy().ends_with(COUNT_SUFFIX) {
                continue;
            }
            // Somebody else's rubbish may stay.
            let _ = std::fs::remove_file(segment);
        }
        let _ = std::fs::remove_dir_all(self.host.transport_directory());
    }

    /// Returns whether a program lives that uses the transport without our lock: none of Dynocar's.
    fn has_strangers(&self) -> bool {
        let mut has_any = false;
        if self.host.transport_directory().exists()
            && let Ok(config) = self.host.transport_config()
        {
            // Files that cannot be listed belong to nobody.
            let _ = Node::<ipc::Service>::list(&config, |node| {
                has_any |= matches!(node, NodeState::Alive(_));
                CallbackProgression::Continue
            });
        }
        has_any
    }

    /// Removes the descriptions of services, and the segments, whose maker or remover was killed: the transport would
    /// wait for some of them, even when it leaves. Nobody else makes one meanwhile, and who is removing one has done so
    /// in a moment.
    fn remove_half_made(&self) {
        let half_made = || {
            let mut found = files_of(&self.host.transport_directory().join("services"));
            if !found.is_empty() {
                let segments = self.segments(&[".dynamic"]);
                found.retain(|it| !is_complete(it, &segments));
            }
            let awaited = self.segments(&[SUFFIX, CONNECTION_SUFFIX]).into_iter();
            found.extend(awaited.filter(|it| is_in_making(it)));
            found
        };
        let first = half_made();
        if !first.is_empty() {
            std::thread::sleep(MADE_TIME);
            for file in half_made().iter().filter(|it| first.contains(it)) {
                let _ = std::fs::remove_file(file);
            }
        }
    }

    /// Refuses to go on when shared memory cannot be written, or there is plainly too little of it. The transport makes
    /// its segments without reserving their memory, and a process that touches a page for which there is none dies of
    /// SIGBUS.
    ///
    /// # Errors
    ///
    /// [`ChannelError::SharedMemoryFull`], [`ChannelError::SharedMemoryUnusable`].
    pub fn require_free_memory(&self) -> Result<(), ChannelError> {
        let unusable = |error: Errno| ChannelError::SharedMemoryUnusable {
            path: SHARED_MEMORY,
            source: error.into(),
        };
        access(SHARED_MEMORY, Access::WRITE_OK | Access::EXEC_OK).map_err(unusable)?;
        // A system that does not know has no limit that we know of.
        let Ok(memory) = rustix::fs::statvfs(SHARED_MEMORY) else { return Ok(()) };
        // No files at all is how a system without a limit of them answers.
        if memory.f_files > 0 && memory.f_favail < FREE_FILES_MIN {
            return Err(unusable(Errno::NOSPC));
        }
        let free = memory.f_bavail.saturating_mul(memory.f_frsize);
        if free >= FREE_BYTES_MIN { Ok(()) } else { Err(full(free, FREE_BYTES_MIN)) }
    }

    /// Reserves every byte of this directory's segments, so that none of them can end a process
    /// later, when others have filled the memory.
    ///
    /// # Errors
    ///
    /// [`ChannelError::SharedMemoryFull`].
    pub fn reserve(&self) -> Result<(), ChannelError> {
        for path in self.segments(&[""]) {
            // One that is gone, or that its maker has not opened yet, is not ours to reserve.
            let Ok(file) = OpenOptions::new().read(true).write(true).open(path) else { continue };
            let length = file.metadata().map_or(0, |it| it.len());
            if length == 0 {
                continue;
            }
            let reserved = rustix::fs::fallocate(&file, FallocateFlags::KEEP_SIZE, 0, length);
            if reserved == Err(Errno::NOSPC) {
                return Err(full(0, length));
            }
        }
        Ok(())
    }

    /// Closes the segment to other users; the transport opens it to all.
    pub fn close_to_others(&self) {
        for segment in self.segments(&[SUFFIX]) {
            // One that belongs to somebody else, or is gone, cannot be closed; a node of ours
            // that could not use it would have said so.
            let _ = std::fs::set_permissions(segment, Permissions::from_mode(0o600));
        }
    }

    /// Returns the segments whose names end in one of some ways.
    fn segments(&self, suffixes: &[&str]) -> Vec<PathBuf> {
        let is_ours = |name: &str| {
            name.starts_with(&self.segment_prefix)
                && suffixes.iter().any(|suffix| name.ends_with(suffix))
        };
        let entries = std::fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
        entries
            .filter(|it| it.file_name().to_str().is_some_and(is_ours))
            .map(|it| it.path())
            .collect()
    }
}

/// Returns true for a description that is written, and whose segment is ready.
fn is_complete(service: &Path, segments: &[PathBuf]) -> bool {
    let number = |text: &str, key: &str| -> Option<u128> {
        text.lines().find_map(|line| line.strip_prefix(key))?.parse().ok()
    };
    let segment = || {
        let text = std::fs::read_to_string(service).ok()?;
        let low = number(&text, "payload_value = ")?;
        let name = format!("_{}.dynamic", (number(&text, "unique_value = ")? << 64) | low);
        segments.iter().find(|it| it.to_string_lossy().ends_with(&name))
    };
    mode_of(service) != Some(DESCRIPTION_IN_MAKING) && segment().is_some_and(|it| !is_in_making(it))
}

fn is_in_making(segment: &Path) -> bool {
    mode_of(segment) == Some(SEGMENT_IN_MAKING)
}

fn mode_of(path: &Path) -> Option<u32> {
    std::fs::metadata(path).ok().map(|it| it.permissions().mode() & 0o777)
}

fn files_of(directory: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(directory).into_iter().flatten();
    entries.filter_map(|entry| Some(entry.ok()?.path())).collect()
}

/// Takes the lock of a file, or directory, that others hold for moments only.
fn wait_for(path: &Path, lock: impl Fn() -> Result<(), TryLockError>) -> Result<(), ChannelError> {
    let start = Instant::now();
    loop {
        match lock() {
            Ok(()) => return Ok(()),
            Err(TryLockError::Error(source)) => return Err(unusable(path, "locking")(source)),
            Err(TryLockError::WouldBlock) if start.elapsed() < LOCK_TIME => {
                std::thread::sleep(PAUSE);
            }
            Err(TryLockError::WouldBlock) => {
                let waited_s = LOCK_TIME.as_secs();
                return Err(ChannelError::Locked { path: path.into(), waited_s });
            }
        }
    }
}

/// Returns the refusal where shared memory is full.
pub fn full(free: u64, needed: u64) -> ChannelError {
    ChannelError::SharedMemoryFull {
        path: SHARED_MEMORY,
        free_kib: free / 1024,
        needed_kib: needed.div_ceil(1024),
    }
}

impl Drop for Users {
    fn drop(&mut self) {
        if self.lock.own().is_some_and(|lock| lock.try_lock().is_ok()) && !self.has_strangers() {
            self.remove_all();
            for segment in self.segments(&[COUNT_SUFFIX]) {
                let _ = std::fs::remove_file(segment);
            }
        }
    }
}
