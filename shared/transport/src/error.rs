//! Why a channel cannot be opened or used.

use std::path::PathBuf;

use dynocar_shared::TrainId;

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
        /// What was tried.
        action: &'static str,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The run-time directory's name cannot be used for shared memory.
    #[error(
        "{path}: expected an absolute path of at most {limit} bytes without spaces or special \
         characters, see the variable DYNOCAR_ROOT"
    )]
    RootName {
        /// The directory.
        path: PathBuf,
        /// The longest name allowed, in bytes.
        limit: usize,
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
        /// What the peer says of itself.
        theirs: Box<Announcement>,
        /// What we are.
        ours: Box<Announcement>,
    },
    /// The transport refused a node, a service or a port.
    #[error("{what}: iceoryx2 {} refused: {reason}", dynocar_shared::services::TRANSPORT_VERSION)]
    Transport {
        /// Which node, service or port.
        what: String,
        /// The transport's reason.
        reason: String,
    },
    /// Every place of a train's channel is taken.
    #[error(
        "{channel} of train {train}: all {limit} places are taken. Each reader and each publisher \
         takes one until it is closed or its process ends; the daemon takes one for each of its \
         threads, for metrics and for kept estimates. Close those you no longer need, or let one \
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
        /// What is free.
        free_kib: u64,
        /// What is needed.
        needed_kib: u64,
    },
    /// A message was not taken.
    #[error(transparent)]
    Send(#[from] SendRefused),
}

/// The transport took no message; the sender goes on, the message is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the transport took no message")]
pub struct SendRefused;
