//! Identity of a file, a directory or the shared memory, whatever its name.

use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Where the system keeps shared memory by name.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

/// A directory, whatever it is called: its device and its inode.
pub(crate) type Identity = [u64; 2];

/// The identity of the directory at a path.
pub(crate) fn identity_of(path: &Path) -> std::io::Result<Identity> {
    std::fs::metadata(path).map(|it| identity(&it))
}

/// The identity of the file or directory of these attributes.
pub(crate) fn identity(attributes: &Metadata) -> Identity {
    [attributes.dev(), attributes.ino()]
}
