//! The run-time files of this host, and its monotonic clock, common to all its processes.
//!
//! A root directory holds, in `trains/`, the announcements of who serves and who drives each train. The transport's
//! files lie with its segments in `/dev/shm`, under names that follow from the root's device, inode and time of
//! creation: two spellings of one directory give the same names, two directories never do, even if one is removed and
//! another made, and the sockets' names are short for a long root, too.

use std::fs::{DirBuilder, File, OpenOptions, Permissions};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use dynocar_shared::services::{ROOT_VARIABLE, SEGMENT_PREFIX};
use iceoryx2::prelude::{Config, FileName, Path as TransportPath, SemanticString};
use rustix::io::Errno;
use rustix::process::{Resource, getrlimit};
use rustix::time::{ClockId, clock_gettime};

use crate::announcement::{DirectoryIdentity, SHARED_MEMORY};
use crate::error::ChannelError;

/// Longest root directory in bytes: the system's limit of a path, less the names of files in it.
const ROOT_BYTES_MAX: usize = 4000;

/// Connections to dead senders whose last messages are still kept. A receiver looks through a place for each of them
/// whenever it is polled: the transport's default of 128 took more than half of the time of a poll. Without a place the
/// dead sender's last message is dropped, and it is older than the messages of its successor.
const EXPIRED_CONNECTIONS: usize = 8;

/// Longest wait of the transport for something that another process is making; no process of ours makes anything at the
/// same time as another.
const MAKING_TIME: Duration = Duration::from_millis(200);

/// The announcements' directory in the root.
const TRAINS: &str = "trains";

/// The run-time directory of one host, or of one of its separate installations.
///
/// # Examples
///
/// ```
/// use dynocar_transport::Host;
///
/// # let folder = tempfile::tempdir()?;
/// let root = folder.path().join("depot");
/// let host = Host::at(&root)?;
/// assert_eq!(host.root(), root);
/// // A relative path is no root: two processes would not mean the same.
/// assert!(Host::at("depot".as_ref()).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Host {
    root: PathBuf,
    identity: DirectoryIdentity,
}

impl Host {
    /// Returns the root that the variable `DYNOCAR_ROOT` names, else `/tmp/dynocar-<user id>`.
    ///
    /// # Errors
    ///
    /// See [`Host::at`].
    pub fn from_environment() -> Result<Self, ChannelError> {
        match std::env::var_os(ROOT_VARIABLE) {
            Some(root) if !root.is_empty() => Host::at(Path::new(&root)),
            _ => {
                let user = rustix::process::geteuid().as_raw();
                Host::at(Path::new(&format!("/tmp/dynocar-{user}")))
            }
        }
    }

    /// Returns a root of its own where one is named, else that of the environment.
    ///
    /// # Errors
    ///
    /// See [`Host::at`].
    pub fn of(root: Option<&Path>) -> Result<Self, ChannelError> {
        root.map_or_else(Host::from_environment, Host::at)
    }

    /// Returns a root of its own; the directory is made, for this user only, when it is missing.
    ///
    /// # Errors
    ///
    /// When the path is relative or too long, cannot be made, or belongs to someone else.
    pub fn at(root: &Path) -> Result<Self, ChannelError> {
        Host::check_name(root)?;
        require_own(root)?;
        for directory in [root, &root.join(TRAINS)] {
            make_private_directory(directory)?;
        }
        let identity = DirectoryIdentity::from_path(root)
            .map_err(unusable(root, "looking at the directory"))?;
        Ok(Host { root: root.to_path_buf(), identity })
    }

    /// Checks the name of a root, whether it is there or not.
    ///
    /// # Errors
    ///
    /// When it is relative, too long or no plain name.
    pub fn check_name(root: &Path) -> Result<(), ChannelError> {
        let is_plain = |byte: &u8| byte.is_ascii_alphanumeric() || b"/._-+".contains(byte);
        let bytes = root.as_os_str().as_encoded_bytes();
        if bytes.len() > ROOT_BYTES_MAX {
            let (path, length, limit) = (root.into(), bytes.len(), ROOT_BYTES_MAX);
            return Err(ChannelError::RootLength { path, length, limit });
        }
        if !root.is_absolute() || !bytes.iter().all(is_plain) {
            return Err(ChannelError::RootName { path: root.into() });
        }
        Ok(())
    }

    /// Returns the root directory.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Returns where the announcements lie.
    pub fn trains_directory(&self) -> PathBuf {
        self.root.join(TRAINS)
    }

    /// Returns where the transport keeps its files, apart from its segments: in memory, so that nothing of a dead
    /// host's is left, and nothing is aged.
    pub fn transport_directory(&self) -> PathBuf {
        let prefix = self.segment_prefix();
        Path::new(SHARED_MEMORY).join(format!(".{}", prefix.trim_end_matches('_')))
    }

    /// Prefix of this root's shared-memory segments.
    pub fn segment_prefix(&self) -> String {
        format!("{SEGMENT_PREFIX}{:08x}_", self.identity.hash())
    }

    /// Requires that the root is the directory that it was.
    ///
    /// # Errors
    ///
    /// [`ChannelError::RootGone`] when it was removed, or another one took its place.
    pub fn require_root(&self) -> Result<(), ChannelError> {
        match DirectoryIdentity::from_path(&self.root) {
            Ok(identity) if identity == self.identity => Ok(()),
            _ => Err(ChannelError::RootGone { path: self.root.clone() }),
        }
    }

    /// Opens the root, to be locked.
    ///
    /// # Errors
    ///
    /// [`ChannelError::RootGone`], and the system's refusals.
    pub(crate) fn open_root(&self) -> Result<File, ChannelError> {
        self.require_root()?;
        File::open(&self.root).map_err(unusable(&self.root, "opening"))
    }

    /// Returns the transport's configuration for this root.
    ///
    /// # Errors
    ///
    /// When the transport's directory cannot be made.
    pub(crate) fn transport_config(&self) -> Result<Config, ChannelError> {
        let directory = self.transport_directory();
        make_private_directory(&directory)?;
        let refused = || ChannelError::RootName { path: directory.clone() };
        let mut config = Config::default();
        config.global.prefix =
            FileName::new(self.segment_prefix().as_bytes()).map_err(|_| refused())?;
        let path =
            TransportPath::new(directory.as_os_str().as_encoded_bytes()).map_err(|_| refused())?;
        config.global.set_root_path(&path);
        config.global.creation_timeout = MAKING_TIME;
        // The dead are cleared away by those who come, one at a time, and not by those who leave.
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.defaults.publish_subscribe.subscriber_expired_connection_buffer =
            EXPIRED_CONNECTIONS;
        Ok(config)
    }
}

/// Returns the failure of a system call on a file or a directory.
pub(crate) fn unusable<'a>(
    path: &'a Path,
    action: &'static str,
) -> impl FnOnce(std::io::Error) -> ChannelError + 'a {
    move |source| match source.raw_os_error().map(Errno::from_raw_os_error) {
        Some(Errno::MFILE | Errno::NFILE) => {
            ChannelError::OpenFiles { limit: getrlimit(Resource::Nofile).current }
        }
        _ => ChannelError::Directory { path: path.to_path_buf(), action, source },
    }
}

/// Refuses a directory that others use: closing it to them would harm the system.
fn require_own(root: &Path) -> Result<(), ChannelError> {
    // A directory that is not there, or cannot be looked at, is made or refused next.
    let Ok(attributes) = std::fs::metadata(root) else { return Ok(()) };
    let is_private = attributes.mode() & 0o077 == 0;
    let is_used = || std::fs::read_dir(root).is_ok_and(|mut it| it.next().is_some());
    let is_of_the_system = || {
        attributes.mode() & 0o1000 != 0
            || root.canonicalize().is_ok_and(|it| it.components().count() <= 2)
    };
    if attributes.is_dir()
        && !is_private
        && !root.join(TRAINS).is_dir()
        && (is_used() || is_of_the_system())
    {
        return Err(ChannelError::RootShared { path: root.into() });
    }
    Ok(())
}

/// Opens a file of this user alone for reading and writing, and makes it when it is not there.
pub(crate) fn open_private(path: &Path) -> std::io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false).mode(0o600).open(path)
}

/// Makes a directory for this user only; an existing one must belong to this user.
fn make_private_directory(path: &Path) -> Result<(), ChannelError> {
    let failed = |action| unusable(path, action);
    DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(path)
        .map_err(failed("making the directory"))?;
    let attributes = std::fs::metadata(path).map_err(failed("looking at the directory"))?;
    let owner = attributes.uid();
    if owner != rustix::process::geteuid().as_raw() {
        return Err(ChannelError::RootOfAnother { path: path.into(), owner });
    }
    if attributes.mode() & 0o077 != 0 {
        std::fs::set_permissions(path, Permissions::from_mode(0o700))
            .map_err(failed("closing the directory to other users"))?;
    }
    Ok(())
}

/// Returns the nanoseconds since boot, never set back; read through the vDSO, without a system call.
pub fn monotonic_now_ns() -> i64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_is_made_for_this_user_only() {
        let parent = tempfile::tempdir().unwrap();
        let host = Host::at(&parent.path().join("a/b")).unwrap();
        let mode = std::fs::metadata(host.trains_directory()).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o700);
    }

    #[test]
    fn each_directory_has_segments_of_its_own_by_whatever_name() {
        let parent = tempfile::tempdir().unwrap();
        let one = Host::at(&parent.path().join("one")).unwrap();
        let other = Host::at(&parent.path().join("other")).unwrap();
        assert_ne!(one.segment_prefix(), other.segment_prefix());
        std::os::unix::fs::symlink(one.root(), parent.path().join("link")).unwrap();
        for spelling in ["one/", "./one", "link", "other/../one"] {
            let same = Host::at(&parent.path().join(spelling)).unwrap();
            assert_eq!(same.segment_prefix(), one.segment_prefix(), "{spelling}");
        }
        std::fs::rename(one.root(), parent.path().join("gone")).unwrap();
        assert!(matches!(one.require_root(), Err(ChannelError::RootGone { .. })));
    }

    #[test]
    fn a_directory_made_anew_has_nothing_of_the_one_removed() {
        let parent = tempfile::tempdir().unwrap();
        let root = parent.path().join("depot");
        let mut before = Vec::new();
        for _ in 0..8 {
            let prefix = Host::at(&root).unwrap().segment_prefix();
            assert!(!before.contains(&prefix), "{prefix}");
            before.push(prefix);
            std::fs::remove_dir_all(&root).unwrap();
            // File systems tell births apart by the ticks of the system's clock.
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
    }

    #[test]
    fn a_root_may_be_as_long_as_the_system_lets_it() {
        let parent = tempfile::tempdir().unwrap();
        let mut root = parent.path().to_path_buf();
        while root.as_os_str().len() < ROOT_BYTES_MAX - 101 {
            root.push("d".repeat(100));
        }
        let host = Host::at(&root).unwrap();
        assert!(host.transport_directory().as_os_str().len() < 40);
        let message = Host::at(&root.join("d".repeat(101))).unwrap_err().to_string();
        assert!(message.contains("bytes long, at most 4000"), "{message}");
    }

    #[test]
    fn a_directory_that_others_use_is_refused_and_stays_as_it_was() {
        let parent = tempfile::tempdir().unwrap();
        let used = parent.path().join("used");
        std::fs::create_dir_all(used.join("of others")).unwrap();
        std::fs::set_permissions(&used, Permissions::from_mode(0o755)).unwrap();
        let message = Host::at(&used).unwrap_err().to_string();
        assert!(message.contains("a directory of its own"), "{message}");
        assert_eq!(std::fs::metadata(&used).unwrap().mode() & 0o777, 0o755);
        for system in ["/", "/tmp", "/dev/shm", "/usr", "/tmp/../usr/"] {
            assert!(require_own(Path::new(system)).is_err(), "{system}");
        }
    }

    #[test]
    fn a_relative_or_spaced_root_is_refused_in_words() {
        let message = Host::at(Path::new("here")).unwrap_err().to_string();
        assert!(message.contains("expected an absolute path"), "{message}");
        assert!(Host::at(Path::new("/tmp/a b")).is_err());
    }

    #[test]
    fn a_file_in_the_place_of_the_root_is_named() {
        let parent = tempfile::tempdir().unwrap();
        let file = parent.path().join("file");
        std::fs::write(&file, "").unwrap();
        let message = Host::at(&file).unwrap_err().to_string();
        assert!(message.contains("file"), "{message}");
    }
}
