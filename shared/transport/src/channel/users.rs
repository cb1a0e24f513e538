//! Who uses the transport of a run-time directory, to tidy up after the last of them.
//!
//! The transport keeps one small segment for each run-time directory for good (it numbers the
//! nodes), open to every user of the host. Here it is closed to others, and removed by the last
//! process that leaves. Every port holds a shared lock; who can turn it into an exclusive one is
//! alone, and nobody can come in until the lock is let go.

use std::fs::{File, OpenOptions, Permissions, TryLockError};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::FallocateFlags;

use crate::error::ChannelError;
use crate::host::{Host, open_private};

/// Where the system keeps shared memory by name.
pub const SHARED_MEMORY: &str = "/dev/shm";
/// How the segment's name ends.
const SUFFIX: &str = ".global_mgmt";
/// How the names of the pages end that count samples, see [`super::SampleCount`].
pub const COUNT_SUFFIX: &str = ".count";
/// What a few ports take with their services and connections, with a margin.
const FREE_BYTES_MIN: u64 = 4 << 20;
/// The last one to leave tidies up within microseconds; a newcomer waits for it.
const TRIES: u32 = 250;
const PAUSE: Duration = Duration::from_millis(4);

/// A user of the transport, until dropped.
#[derive(Debug)]
pub struct Users {
    lock: File,
    segment_prefix: String,
}

impl Users {
    /// Enters a run-time directory.
    ///
    /// # Errors
    ///
    /// When the lock cannot be had.
    pub fn enter(host: &Host) -> Result<Self, ChannelError> {
        let path = host.root().join("users.lock");
        let failed = |action| {
            let path = path.clone();
            move |source| ChannelError::Directory { path, action, source }
        };
        let lock = open_private(&path).map_err(failed("opening"))?;
        for _ in 0..TRIES {
            match lock.try_lock_shared() {
                Ok(()) => return Ok(Users { lock, segment_prefix: host.segment_prefix() }),
                Err(TryLockError::WouldBlock) => std::thread::sleep(PAUSE),
                Err(TryLockError::Error(source)) => return Err(failed("locking")(source)),
            }
        }
        Err(failed("locking")(std::io::ErrorKind::TimedOut.into()))
    }

    /// Refuses to go on when there is plainly too little memory. The transport makes its segments
    /// without reserving them, and whoever touches a page that is not to be had dies of SIGBUS.
    ///
    /// # Errors
    ///
    /// [`ChannelError::SharedMemoryFull`].
    pub fn require_free_memory(&self) -> Result<(), ChannelError> {
        // A system that does not know has no limit that we know of.
        let Ok(memory) = rustix::fs::statvfs(SHARED_MEMORY) else { return Ok(()) };
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
        for path in self.segments("") {
            // One that is gone, or that its maker has not opened yet, is not ours to reserve.
            let Ok(file) = OpenOptions::new().read(true).write(true).open(path) else { continue };
            let length = file.metadata().map_or(0, |it| it.len());
            if length == 0 {
                continue;
            }
            let reserved = rustix::fs::fallocate(&file, FallocateFlags::KEEP_SIZE, 0, length);
            if reserved == Err(rustix::io::Errno::NOSPC) {
                return Err(full(0, length));
            }
        }
        Ok(())
    }

    /// Closes the segment to other users; the transport opens it to all.
    pub fn close_to_others(&self) {
        for segment in self.segments(SUFFIX) {
            // One that belongs to somebody else, or is gone, cannot be closed; a node of ours
            // that could not use it would have said so.
            let _ = std::fs::set_permissions(segment, Permissions::from_mode(0o600));
        }
    }

    fn segments(&self, suffix: &str) -> Vec<PathBuf> {
        let is_ours = |name: &str| name.starts_with(&self.segment_prefix) && name.ends_with(suffix);
        std::fs::read_dir(Path::new(SHARED_MEMORY))
            .into_iter()
            .flatten()
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.file_name().and_then(|name| name.to_str()).is_some_and(is_ours))
            .collect()
    }
}

/// The refusal where shared memory is full.
pub fn full(free: u64, needed: u64) -> ChannelError {
    ChannelError::SharedMemoryFull {
        path: SHARED_MEMORY,
        free_kib: free / 1024,
        needed_kib: needed.div_ceil(1024),
    }
}

impl Drop for Users {
    fn drop(&mut self) {
        if self.lock.try_lock().is_ok() {
            for segment in self.segments(SUFFIX).into_iter().chain(self.segments(COUNT_SUFFIX)) {
                // Somebody else's rubbish may stay.
                let _ = std::fs::remove_file(segment);
            }
        }
    }
}
