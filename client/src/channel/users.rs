//! Who uses the transport of a run-time directory, to tidy up after the last of them.
//!
//! The transport keeps one small segment for each run-time directory for good (it numbers the
//! nodes), open to every user of the host. Here it is closed to others, and removed by the last
//! process that leaves. Every port holds a shared lock; who can turn it into an exclusive one is
//! alone, and nobody can come in until the lock is let go.

use std::fs::{File, OpenOptions, Permissions, TryLockError};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::error::ChannelError;
use crate::host::Host;

/// Where the system keeps shared memory by name.
const SHARED_MEMORY: &str = "/dev/shm";
/// How the segment's name ends.
const SUFFIX: &str = ".global_mgmt";
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
        let lock = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .open(&path)
            .map_err(failed("opening"))?;
        for _ in 0..TRIES {
            match lock.try_lock_shared() {
                Ok(()) => return Ok(Users { lock, segment_prefix: host.segment_prefix() }),
                Err(TryLockError::WouldBlock) => std::thread::sleep(PAUSE),
                Err(TryLockError::Error(source)) => return Err(failed("locking")(source)),
            }
        }
        Err(failed("locking")(std::io::ErrorKind::TimedOut.into()))
    }

    /// Closes the segment to other users; the transport opens it to all.
    pub fn close_to_others(&self) {
        for segment in self.segments() {
            // One that belongs to somebody else, or is gone, cannot be closed; a node of ours
            // that could not use it would have said so.
            let _ = std::fs::set_permissions(segment, Permissions::from_mode(0o600));
        }
    }

    fn segments(&self) -> Vec<PathBuf> {
        let is_ours = |name: &str| name.starts_with(&self.segment_prefix) && name.ends_with(SUFFIX);
        std::fs::read_dir(Path::new(SHARED_MEMORY))
            .into_iter()
            .flatten()
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.file_name().and_then(|name| name.to_str()).is_some_and(is_ours))
            .collect()
    }
}

impl Drop for Users {
    fn drop(&mut self) {
        if self.lock.try_lock().is_ok() {
            for segment in self.segments() {
                // Somebody else's rubbish may stay.
                let _ = std::fs::remove_file(segment);
            }
        }
    }
}
