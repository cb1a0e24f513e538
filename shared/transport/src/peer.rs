//! The serving and the driving side of a train, and their compatibility.
//!
//! Each side keeps a small text file locked while it lives. The kernel drops the lock when the
//! process dies, however it dies, so that a locked file means a living peer. The files lie
//! outside the transport and state schema, layouts and transport version: a peer that shares no
//! memory format with us can still be named in words.

use std::fs::{File, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::PathBuf;
use std::time::Duration;

use dynocar_shared::{ParameterSnapshot, TrainId};

use crate::announcement::{Announcement, Role, identity, identity_of};
use crate::channel::process::LockedFile;
use crate::error::ChannelError;
use crate::host::{Host, open_private, unusable};

/// State of the other side, as far as it is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Peer {
    /// Nobody holds the role.
    Absent,
    /// A living process holds it and maps the same bytes.
    Compatible(Announcement),
    /// A living process holds it, and we cannot understand each other.
    Incompatible(Announcement),
}

impl Peer {
    /// Returns who holds a role for a train now.
    ///
    /// Opens a file: call it outside the control cycle.
    ///
    /// # Errors
    ///
    /// When the announcement exists but cannot be read, or the root directory is gone.
    pub fn look_up(host: &Host, train: TrainId, role: Role) -> Result<Peer, ChannelError> {
        host.require_root()?;
        let path = announcement_path(host, train, role);
        let file = match File::open(&path) {
            Ok(file) => file,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Peer::Absent),
            Err(source) => return Err(unusable(&path, "opening")(source)),
        };
        match file.try_lock_shared() {
            Ok(()) => Ok(Peer::Absent),
            Err(TryLockError::Error(source)) => Err(unusable(&path, "locking")(source)),
            Err(TryLockError::WouldBlock) => Ok(match read_announcement(&file, role) {
                None => Peer::Absent,
                Some(theirs) if theirs.is_compatible_with(&Announcement::of_this_process(role)) => {
                    Peer::Compatible(theirs)
                }
                Some(theirs) => Peer::Incompatible(theirs),
            }),
        }
    }

    /// Returns the trains for which a living process holds a role, in order.
    ///
    /// # Errors
    ///
    /// When the run-time directory cannot be read.
    pub fn trains(host: &Host, role: Role) -> Result<Vec<TrainId>, ChannelError> {
        let directory = host.trains_directory();
        let entries = std::fs::read_dir(&directory).map_err(unusable(&directory, "reading"))?;
        let suffix = format!(".{role}");
        let train_of = |name: &str| name.strip_suffix(&suffix)?.parse().ok().map(TrainId);
        let mut trains: Vec<TrainId> = entries
            .filter_map(|entry| train_of(entry.ok()?.file_name().to_str()?))
            .filter(|&train| !matches!(Peer::look_up(host, train, role), Ok(Peer::Absent)))
            .collect();
        trains.sort_unstable();
        Ok(trains)
    }

    /// Turns an incompatible peer into an error.
    ///
    /// # Errors
    ///
    /// [`ChannelError::IncompatiblePeer`] when the peer is incompatible.
    pub fn require_compatible(self, train: TrainId, our_role: Role) -> Result<Peer, ChannelError> {
        match self {
            Peer::Incompatible(theirs) => Err(ChannelError::of_peer(train, theirs, our_role)),
            peer => Ok(peer),
        }
    }
}

/// Holds a role for a train; dropping it, or dying, gives the role back.
#[derive(Debug)]
pub struct RoleLock {
    file: LockedFile,
    path: PathBuf,
}

/// A look-up holds the lock for a moment; a claim waits that long before it believes a refusal.
const CLAIM_TRIES: u32 = 25;
const CLAIM_PAUSE: Duration = Duration::from_millis(4);

impl RoleLock {
    /// Takes a role for a train, unless a living process holds it.
    ///
    /// # Errors
    ///
    /// [`ChannelError::Occupied`] names the holder.
    pub fn claim(host: &Host, train: TrainId, role: Role) -> Result<Self, ChannelError> {
        let path = announcement_path(host, train, role);
        let mut file = open_private(&path).map_err(unusable(&path, "opening"))?;
        let mut tries = 0;
        while let Err(error) = file.try_lock() {
            tries += 1;
            match error {
                TryLockError::Error(source) => return Err(unusable(&path, "locking")(source)),
                TryLockError::WouldBlock if tries < CLAIM_TRIES => std::thread::sleep(CLAIM_PAUSE),
                TryLockError::WouldBlock => {
                    let holder = read_announcement(&file, role)
                        .map_or("a process that is just starting".into(), |it| it.to_string());
                    return Err(ChannelError::Occupied { train, role, holder });
                }
            }
        }
        // Prefix and size are for those who read from outside, by the transport alone.
        let text = Announcement::of_this_process(role).to_text()
            + &format!(
                "segments={}\nsnapshot_bytes={}\n",
                host.segment_prefix(),
                size_of::<ParameterSnapshot>()
            );
        file.set_len(0)
            .and_then(|()| file.write_all(text.as_bytes()))
            .map_err(unusable(&path, "writing"))?;
        Ok(RoleLock { file: LockedFile::new(file), path })
    }

    /// Requires that others find the announcement where they look for it.
    ///
    /// # Errors
    ///
    /// [`ChannelError::RootGone`] when somebody removed it.
    pub fn require_there(&self, host: &Host) -> Result<(), ChannelError> {
        let is_same =
            || Some(identity_of(&self.path).ok()? == identity(&self.file.metadata().ok()?));
        match is_same() {
            Some(true) => host.require_root(),
            _ => Err(ChannelError::RootGone { path: self.path.clone() }),
        }
    }
}

fn announcement_path(host: &Host, train: TrainId, role: Role) -> PathBuf {
    host.trains_directory().join(format!("{train}.{role}"))
}

/// `None` while the holder is still writing.
fn read_announcement(mut file: &File, role: Role) -> Option<Announcement> {
    let mut text = String::new();
    file.rewind().ok()?;
    file.take(4096).read_to_string(&mut text).ok()?;
    Announcement::from_text(role, &text)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRAIN: TrainId = TrainId(5);

    fn host() -> (tempfile::TempDir, Host) {
        let directory = tempfile::tempdir().unwrap();
        let host = Host::at(directory.path()).unwrap();
        (directory, host)
    }

    #[test]
    fn a_held_role_is_seen_and_a_dropped_one_is_absent() {
        let (_directory, host) = host();
        assert_eq!(Peer::look_up(&host, TRAIN, Role::Daemon).unwrap(), Peer::Absent);
        let lock = RoleLock::claim(&host, TRAIN, Role::Daemon).unwrap();
        let ours = Announcement::of_this_process(Role::Daemon);
        assert_eq!(Peer::look_up(&host, TRAIN, Role::Daemon).unwrap(), Peer::Compatible(ours));
        drop(lock);
        assert_eq!(Peer::look_up(&host, TRAIN, Role::Daemon).unwrap(), Peer::Absent);
    }

    #[test]
    fn the_trains_of_a_role_are_those_of_living_processes() {
        let (_directory, host) = host();
        let claim = |train| RoleLock::claim(&host, TrainId(train), Role::Daemon).unwrap();
        let (_twelve, _five, gone) = (claim(12), claim(5), claim(7));
        drop(gone);
        let _controller = RoleLock::claim(&host, TrainId(9), Role::Controller).unwrap();
        std::fs::write(host.trains_directory().join("x.daemon"), "").unwrap();
        assert_eq!(Peer::trains(&host, Role::Daemon).unwrap(), [TrainId(5), TrainId(12)]);
    }

    #[test]
    fn a_second_daemon_on_a_train_is_refused_by_name() {
        let (_directory, host) = host();
        let _lock = RoleLock::claim(&host, TRAIN, Role::Daemon).unwrap();
        let message = RoleLock::claim(&host, TRAIN, Role::Daemon).unwrap_err().to_string();
        let expected =
            format!("train 5: already has a daemon: daemon {}", env!("CARGO_PKG_VERSION"));
        assert!(message.starts_with(&expected), "{message}");
        assert!(message.contains(&std::process::id().to_string()), "{message}");
        assert!(RoleLock::claim(&host, TrainId(6), Role::Daemon).is_ok());
        assert!(RoleLock::claim(&host, TRAIN, Role::Controller).is_ok());
    }

    #[test]
    fn a_peer_of_another_schema_is_named_in_words() {
        let (_directory, host) = host();
        let newer = Announcement { schema: 2, ..Announcement::of_this_process(Role::Daemon) };
        let path = announcement_path(&host, TRAIN, Role::Daemon);
        std::fs::write(&path, newer.to_text() + "added_later=yes\n").unwrap();
        let held = File::open(&path).unwrap();
        held.lock().unwrap();
        let peer = Peer::look_up(&host, TRAIN, Role::Daemon).unwrap();
        assert_eq!(peer, Peer::Incompatible(newer));
        let message = peer.require_compatible(TRAIN, Role::Controller).unwrap_err().to_string();
        assert!(message.contains("the daemon is incompatible"), "{message}");
        assert!(message.contains("schema 2") && message.contains("schema 1"), "{message}");
    }

    #[test]
    fn text_that_is_no_announcement_reads_as_absent() {
        let (_directory, host) = host();
        let path = announcement_path(&host, TRAIN, Role::Daemon);
        std::fs::write(&path, [0xff, 0xfe, 0x00]).unwrap();
        let held = File::open(&path).unwrap();
        held.lock().unwrap();
        assert_eq!(Peer::look_up(&host, TRAIN, Role::Daemon).unwrap(), Peer::Absent);
    }
}
