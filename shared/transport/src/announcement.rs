//! Announcement of one side of the channel, a daemon or a controller, and the identity of a file, a directory or the
//! shared memory, independent of its name.

use std::fmt;
use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::UNIX_EPOCH;

use dynocar_shared::services::TRANSPORT_VERSION;
use dynocar_shared::{ParameterSnapshot, SCHEMA_MAJOR, TrainSample};

/// A side of the channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Role {
    /// Serves the train: reads samples, writes snapshots.
    Daemon,
    /// Drives the train: writes samples, reads snapshots.
    Controller,
}

impl Role {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Role::Daemon => "daemon",
            Role::Controller => "controller",
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Announcement of a peer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Announcement {
    /// Its side of the channel.
    pub role: Role,
    /// Its process.
    pub process_id: u32,
    /// Release of Dynocar it was built from.
    pub version: String,
    /// Schema major of its channels.
    pub schema: u32,
    /// Release of iceoryx2 it was built with.
    pub transport: String,
    /// Layout hash of its [`TrainSample`].
    pub sample_layout: u64,
    /// Layout hash of its [`ParameterSnapshot`].
    pub snapshot_layout: u64,
    /// Which `/dev/shm` it sees: device and inode. Containers may have one each. `None` where it does not
    /// say, as older releases, whose segments have other names.
    pub memory: Option<[u64; 2]>,
}

impl Announcement {
    /// Returns the announcement of this process.
    pub fn of_this_process(role: Role) -> Self {
        Announcement {
            role,
            process_id: std::process::id(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            schema: SCHEMA_MAJOR,
            transport: TRANSPORT_VERSION.to_owned(),
            sample_layout: TrainSample::LAYOUT_HASH,
            snapshot_layout: ParameterSnapshot::LAYOUT_HASH,
            memory: identity_of(Path::new(SHARED_MEMORY)).ok(),
        }
    }

    /// Returns whether both sides map the same bytes.
    pub fn is_compatible_with(&self, other: &Announcement) -> bool {
        self.understands(other) && self.memory == other.memory
    }

    /// Returns whether both sides are of releases that understand each other.
    pub(crate) fn understands(&self, other: &Announcement) -> bool {
        self.schema == other.schema
            && self.memory.is_some() == other.memory.is_some()
            && self.transport == other.transport
            && self.sample_layout == other.sample_layout
            && self.snapshot_layout == other.snapshot_layout
    }

    pub(crate) fn to_text(&self) -> String {
        let [device, inode] = self.memory.unwrap_or_default();
        format!(
            "role={}\nprocess_id={}\nversion={}\nschema={}\ntransport={}\nsample_layout={:016x}\n\
             snapshot_layout={:016x}\nmemory_device={device:x}\nmemory_inode={inode:x}\n",
            self.role,
            self.process_id,
            self.version,
            self.schema,
            self.transport,
            self.sample_layout,
            self.snapshot_layout
        )
    }

    /// Reads the text that [`Announcement::to_text`] wrote; keys that a newer release adds are ignored.
    pub(crate) fn from_text(role: Role, text: &str) -> Option<Self> {
        let value = |key: &str| {
            text.lines().find_map(|line| line.split_once('=').filter(|pair| pair.0 == key))
        };
        let value = |key| value(key).map(|pair| pair.1);
        let hash = |key| u64::from_str_radix(value(key)?, 16).ok();
        Some(Announcement {
            role,
            process_id: value("process_id")?.parse().ok()?,
            version: value("version")?.to_owned(),
            schema: value("schema")?.parse().ok()?,
            transport: value("transport")?.to_owned(),
            sample_layout: hash("sample_layout")?,
            snapshot_layout: hash("snapshot_layout")?,
            memory: hash("memory_device").zip(hash("memory_inode")).map(|(it, inode)| [it, inode]),
        })
    }
}

impl fmt::Display for Announcement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} {} (process {}, schema {}, sample layout {:016x}, snapshot layout {:016x}, \
             iceoryx2 {})",
            self.role,
            self.version,
            self.process_id,
            self.schema,
            self.sample_layout,
            self.snapshot_layout,
            self.transport
        )
    }
}

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
