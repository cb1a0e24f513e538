//! What latency and load measurements share: a place of their own, processes, traffic.
//!
//! - [`site`]: a run-time directory with a daemon configuration, gone afterwards
//! - [`child`]: processes beside this one, each bound to a core
//! - [`cores`]: cores and priorities
//! - [`host`]: what the host takes away from threads that are always busy
//! - [`motion`]: the samples of a train that swings between 10 and 30 m/s
//! - [`pipelines`]: which pipelines a measurement names
//! - [`quantiles`]: histograms and what is reported of them
//! - [`usage`]: what the kernel says of a process: processor time, memory, faults, switches

pub mod child;
pub mod cores;
pub mod host;
pub mod motion;
pub mod pipelines;
pub mod quantiles;
pub mod site;
pub mod usage;

use std::path::PathBuf;

use dynocar_client::{ChannelError, SendRefused};

/// Why a measurement cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// The system refused.
    #[error("{what}: {source}")]
    System {
        /// What was tried.
        what: &'static str,
        /// The system's answer.
        source: std::io::Error,
    },
    /// A file of the measurement's own cannot be used.
    #[error("{path}: {reason}")]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A store of models does not take a model.
    #[error(transparent)]
    Models(#[from] dynocar::models::ModelsError),
    /// A result cannot be written.
    #[error(transparent)]
    Output(#[from] dynocar::output::OutputError),
    /// A channel cannot be opened.
    #[error(transparent)]
    Channel(#[from] ChannelError),
    /// A message was not taken.
    #[error(transparent)]
    Send(#[from] SendRefused),
    /// The raw transport refused; the floor of the event strategy uses it directly.
    #[error("iceoryx2 refused a {what}: {reason}")]
    Transport {
        /// Node, service or port.
        what: &'static str,
        /// Its reason.
        reason: String,
    },
    /// ZeroMQ refused.
    #[cfg(feature = "zeromq")]
    #[error("ZeroMQ: {0}")]
    ZeroMq(#[from] zmq::Error),
    /// A process of the measurement ended before its time.
    #[error("{what} ended: {status}")]
    Ended {
        /// Which process.
        what: String,
        /// Its exit status.
        status: String,
    },
    /// A process of the measurement does not answer.
    #[error("{what}: no answer within {seconds} s")]
    Silent {
        /// Which process.
        what: String,
        /// How long was waited.
        seconds: u64,
    },
    /// The daemon under measurement failed.
    #[error("daemon: {0}")]
    Daemon(String),
}

/// Names what was tried when the system refuses.
pub fn system(what: &'static str) -> impl FnOnce(std::io::Error) -> RigError {
    move |source| RigError::System { what, source }
}
