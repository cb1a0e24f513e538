//! Identity of a file, a directory or the shared memory, independent of its name.

use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::UNIX_EPOCH;

/// Where the system keeps shared memory by name.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

/// Identity of a directory, independent of its name: its device and its inode.
pub(crate) type Identity = [u64; 2];

/// Returns the identity of the directory at a path.
pub(crate) fn identity_of(path: &Path) -> std::io::Result<Identity> {
    std::fs::metadata(path).map(|it| identity(&it))
}

/// Returns the identity of the file or directory of these attributes.
pub(crate) fn identity(attributes: &Metadata) -> Identity {
    [attributes.dev(), attributes.ino()]
}

/// A directory that cannot be confused with a later one: a removed directory's inode is given to the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct DirectoryIdentity {
    place: Identity,
    /// When it was made, in nanoseconds since 1970; 0 where the file system does not know.
    born_ns: u64,
}

impl DirectoryIdentity {
    /// Returns the identity of the directory at a path.
    pub(crate) fn from_path(path: &Path) -> std::io::Result<Self> {
        let attributes = std::fs::metadata(path)?;
        let born = attributes.created().ok().and_then(|it| it.duration_since(UNIX_EPOCH).ok());
        let born_ns = born.map_or(0, |it| it.as_nanos() as u64);
        Ok(DirectoryIdentity { place: identity(&attributes), born_ns })
    }

    /// Returns a number for its names.
    pub(crate) fn hash(&self) -> u32 {
        let [device, inode] = self.place;
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        for byte in [device, inode, self.born_ns].into_iter().flat_map(u64::to_le_bytes) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
        hash as u32 ^ (hash >> 32) as u32
    }
}
