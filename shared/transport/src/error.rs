//! Errors of opening and using a channel.

use std::path::PathBuf;

use dynocar_shared::TrainId;
use rustix::io::Errno;
use rustix::process::{Resource, getrlimit};

use crate::announcement::{Announcement, Role};

/// Why a channel cannot be opened or used.
#[derive(Debug, thiserror::Error)]
pub enum ChannelError {
    /// A run-time directory or file cannot be used.
    #[error(
        "{path}: {action} failed: {source}; Dynocar needs a directory of its own that it may write, \
         see the variable DYNOCAR_ROOT"
    )]
    Directory {
        /// The directory or file.
        path: PathBuf,
        /// Attempted action.
        action: &'static str,
        /// The system's answer.
        source: std::io::Error,
    },
    /// A lock that others hold for moments only, while they open or leave a channel, stays taken.
    #[error(
        "{path}: another process holds this lock for more than {waited_s} s, where milliseconds are usual: it \
         was stopped while it opened a channel; `fuser {path}` names it, continue or end it"
    )]
    Locked {
        /// The locked file or directory.
        path: PathBuf,
        /// Seconds waited.
        waited_s: u64,
    },
    /// The process has as many open files as it may.
    #[error(
        "open files: the limit{} is reached, nothing more can be opened or connected; raise it by \
         ulimit -n, of a unit by LimitNOFILE=", limit.map_or(String::new(), |it| format!(" of {it}"))
    )]
    OpenFiles {
        /// The process's limit; `None` where it has none, and the system's is reached.
        limit: Option<u64>,
    },
    /// The run-time directory's name cannot be used for shared memory.
    #[error(
        "{path}: expected an absolute path without spaces or special characters, see the variable \
         DYNOCAR_ROOT"
    )]
    RootName {
        /// The directory.
        path: PathBuf,
    },
    /// The run-time directory's name is longer than the system takes.
    #[error(
        "the root directory's name is {length} bytes long, at most {limit} can be used; see the \
         variable DYNOCAR_ROOT: {path}"
    )]
    RootLength {
        /// The directory.
        path: PathBuf,
        /// Its name's length in bytes.
        length: usize,
        /// The longest name in bytes.
        limit: usize,
    },
    /// The run-time directory is one that others use.
    #[error(
        "{path}: is in use by others: Dynocar needs a directory of its own, which it closes to other \
         users; name one below it by the variable DYNOCAR_ROOT"
    )]
    RootShared {
        /// The directory.
        path: PathBuf,
    },
    /// The run-time directory belongs to another user.
    #[error(
        "{path}: belongs to user {owner}, who alone may use it; ask as that user: sudo -u '#{owner}' ..., \
         or name a directory of your own by the variable DYNOCAR_ROOT"
    )]
    RootOfAnother {
        /// The directory.
        path: PathBuf,
        /// Whose it is.
        owner: u32,
    },
    /// The run-time directory is not the one that was opened.
    #[error(
        "{path}: the root directory was removed or replaced while it was in use; who opened it before and \
         who opens it now do not meet. Open again; let no cleaner of old files into it"
    )]
    RootGone {
        /// The directory.
        path: PathBuf,
    },
    /// Another process already holds this role for the train.
    #[error("train {train}: already has a {role}: {holder}")]
    Occupied {
        /// The train.
        train: TrainId,
        /// The role that is taken.
        role: Role,
        /// Who holds it, as far as it says.
        holder: String,
    },
    /// The peer on the other side speaks another schema, layout or transport version.
    #[error("train {train}: the {} is incompatible: {theirs}; this process is {ours}", theirs.role)]
    IncompatiblePeer {
        /// The train.
        train: TrainId,
        /// Announcement of the peer.
        theirs: Box<Announcement>,
        /// Own announcement.
        ours: Box<Announcement>,
    },
    /// The peer on the other side has a shared memory of its own, as containers may.
    #[error(
        "train {train}: the {} (process {}) has a /dev/shm of its own, so that nothing passes between it \
         and this process; let the two share one: docker run --ipc=host, or --ipc=container:NAME with \
         --ipc=shareable for the first; for Kubernetes one pod, or a volume of medium Memory at /dev/shm",
        theirs.role, theirs.process_id
    )]
    SeparateMemory {
        /// The train.
        train: TrainId,
        /// Announcement of the peer.
        theirs: Box<Announcement>,
    },
    /// The transport refused a node, a service or a port.
    #[error("{what}: iceoryx2 {} refused: {reason}", dynocar_shared::services::TRANSPORT_VERSION)]
    Transport {
        /// Which node, service or port.
        what: String,
        /// The transport's reason.
        reason: String,
    },
    /// A program that is none of Dynocar's made a channel first, with settings of its own.
    #[error(
        "service {service}: made with other settings by a program that is none of Dynocar's, used by {users}; \
         end that, and start it again after the daemon: who only opens a service takes its settings"
    )]
    Stranger {
        /// The service.
        service: String,
        /// Who uses it.
        users: String,
    },
    /// Every place of a train's channel is taken.
    #[error(
        "{channel} of train {train}: all {limit} places are taken. Each reader and each publisher \
         takes one until it is closed or its process ends; the daemon takes one for each of its \
         threads, for its log, for metrics and for kept estimates. Close those you no longer need, or let one \
         reader of a process serve all its parts"
    )]
    NoPlaceLeft {
        /// The train.
        train: TrainId,
        /// The channel's name.
        channel: &'static str,
        /// The places that there are.
        limit: usize,
    },
    /// There is too little shared memory left.
    #[error(
        "{path}: shared memory is full: {free_kib} KiB free, at least {needed_kib} KiB needed; \
         using more than there is would end this process by SIGBUS"
    )]
    SharedMemoryFull {
        /// Where shared memory lies.
        path: &'static str,
        /// Free memory.
        free_kib: u64,
        /// Needed memory.
        needed_kib: u64,
    },
    /// Shared memory is not there, or takes no file of this process.
    #[error(
        "{path}: shared memory cannot be used: {source}; it has to be a tmpfs with free inodes that this user \
         may write into: mount -t tmpfs -o mode=1777 tmpfs {path}"
    )]
    SharedMemoryUnusable {
        /// Where shared memory lies.
        path: &'static str,
        /// The system's answer.
        source: std::io::Error,
    },
    /// A message was not taken.
    #[error(transparent)]
    Send(#[from] SendRefused),
}

/// Files that the transport opens at once to make a service or a port.
const FILES_PER_PORT: u64 = 8;

impl ChannelError {
    /// Returns a refusal by the transport, whose reasons do not tell a lack of open files from others.
    pub(crate) fn transport(what: String, reason: String) -> Self {
        let open = match std::fs::read_dir("/proc/self/fd") {
            Ok(files) => files.count() as u64,
            Err(error) if error.raw_os_error() == Some(Errno::MFILE.raw_os_error()) => u64::MAX,
            Err(_) => 0,
        };
        match getrlimit(Resource::Nofile).current {
            Some(limit) if open.saturating_add(FILES_PER_PORT) > limit => {
                ChannelError::OpenFiles { limit: Some(limit) }
            }
            _ => ChannelError::Transport { what, reason },
        }
    }

    /// Returns why nothing passes between an incompatible peer and this process.
    pub fn of_peer(train: TrainId, theirs: Announcement, our_role: Role) -> Self {
        let (theirs, ours) = (Box::new(theirs), Box::new(Announcement::of_this_process(our_role)));
        if ours.understands(&theirs) {
            ChannelError::SeparateMemory { train, theirs }
        } else {
            ChannelError::IncompatiblePeer { train, theirs, ours }
        }
    }
}

/// The transport took no message; the sender goes on, the message is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the transport took no message")]
pub struct SendRefused;
