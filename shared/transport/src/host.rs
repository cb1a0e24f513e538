//! Where the run-time files of this host lie.
//!
//! Everything is under one root directory: `trains/` holds who serves and who drives each train,
//! `iceoryx2-<version>/` belongs to the transport. Two roots never meet, not even in the names
//! of their shared-memory segments, so that tests and separate installations stay apart.

use std::fs::{DirBuilder, File, OpenOptions, Permissions};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

use dynocar_shared::services::{ROOT_VARIABLE, SEGMENT_PREFIX, TRANSPORT_VERSION};
use iceoryx2::prelude::{Config, FileName, Path as TransportPath, SemanticString};

use crate::error::ChannelError;

/// Longest root directory in bytes: the transport appends file names of its own.
const ROOT_BYTES_MAX: usize = 150;

/// Connections to dead senders whose last messages are still kept. A receiver looks through a
/// place for each of them whenever it is polled: the transport's default of 128 took more than
/// half of the time of a poll. Without a place the dead sender's last message is dropped, and it
/// is older than what its successor says.
const EXPIRED_CONNECTIONS: usize = 8;

/// The run-time directory of one host, or of one of its separate installations.
#[derive(Clone, Debug)]
pub struct Host {
    root: PathBuf,
}

impl Host {
    /// The root that the variable `DYNOCAR_ROOT` names, else `/tmp/dynocar-<user id>`.
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

    /// A root of its own where one is named, else that of the environment.
    ///
    /// # Errors
    ///
    /// See [`Host::at`].
    pub fn of(root: Option<&Path>) -> Result<Self, ChannelError> {
        root.map_or_else(Host::from_environment, Host::at)
    }

    /// A root of its own; the directory is made, for this user only, when it is missing.
    ///
    /// # Errors
    ///
    /// When the path is relative or too long, cannot be made, or belongs to someone else.
    pub fn at(root: &Path) -> Result<Self, ChannelError> {
        let is_plain = |byte: &u8| byte.is_ascii_alphanumeric() || b"/._-+".contains(byte);
        let bytes = root.as_os_str().as_encoded_bytes();
        if !root.is_absolute() || bytes.len() > ROOT_BYTES_MAX || !bytes.iter().all(is_plain) {
            return Err(ChannelError::RootName { path: root.into(), limit: ROOT_BYTES_MAX });
        }
        let host = Host { root: root.to_path_buf() };
        for directory in [host.root.clone(), host.trains_directory(), host.transport_directory()] {
            make_private_directory(&directory)?;
        }
        Ok(host)
    }

    /// The root directory.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Where the announcements lie.
    pub fn trains_directory(&self) -> PathBuf {
        self.root.join("trains")
    }

    fn transport_directory(&self) -> PathBuf {
        self.root.join(format!("iceoryx2-{TRANSPORT_VERSION}"))
    }

    /// Prefix of this root's shared-memory segments.
    pub fn segment_prefix(&self) -> String {
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        for byte in self.root.as_os_str().as_encoded_bytes() {
            hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
        format!("{SEGMENT_PREFIX}{:08x}_", hash as u32 ^ (hash >> 32) as u32)
    }

    /// The transport's configuration for this root.
    ///
    /// # Errors
    ///
    /// When the transport does not take the root's name.
    pub(crate) fn transport_config(&self) -> Result<Config, ChannelError> {
        let directory = self.transport_directory();
        let refused = || ChannelError::RootName { path: directory.clone(), limit: ROOT_BYTES_MAX };
        let mut config = Config::default();
        config.global.prefix =
            FileName::new(self.segment_prefix().as_bytes()).map_err(|_| refused())?;
        let path =
            TransportPath::new(directory.as_os_str().as_encoded_bytes()).map_err(|_| refused())?;
        config.global.set_root_path(&path);
        config.defaults.publish_subscribe.subscriber_expired_connection_buffer =
            EXPIRED_CONNECTIONS;
        Ok(config)
    }
}

/// Opens a file of this user alone for reading and writing, and makes it when it is not there.
pub(crate) fn open_private(path: &Path) -> std::io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false).mode(0o600).open(path)
}

/// Makes a directory for this user only; an existing one must belong to this user.
fn make_private_directory(path: &Path) -> Result<(), ChannelError> {
    let failed =
        |action| move |source| ChannelError::Directory { path: path.to_path_buf(), action, source };
    DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(path)
        .map_err(failed("making the directory"))?;
    let attributes = std::fs::metadata(path).map_err(failed("looking at the directory"))?;
    let owner = std::os::unix::fs::MetadataExt::uid(&attributes);
    if owner != rustix::process::geteuid().as_raw() {
        let source = std::io::Error::new(
            std::io::ErrorKind::PermissionDenied,
            format!("it belongs to user {owner}"),
        );
        return Err(failed("using the directory")(source));
    }
    if attributes.permissions().mode() & 0o077 != 0 {
        std::fs::set_permissions(path, Permissions::from_mode(0o700))
            .map_err(failed("closing the directory to other users"))?;
    }
    Ok(())
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
    fn roots_of_other_names_have_other_segments() {
        let parent = tempfile::tempdir().unwrap();
        let one = Host::at(&parent.path().join("one")).unwrap();
        let other = Host::at(&parent.path().join("other")).unwrap();
        assert_ne!(one.segment_prefix(), other.segment_prefix());
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
