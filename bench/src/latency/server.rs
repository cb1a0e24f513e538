//! The processes that a case is measured against: the hidden command `peer`.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use dynocar::config::DaemonConfig;
use dynocar_client::channel::{Receiver, Sender, Transport};
use dynocar_client::{Host, monotonic_now_ns};
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainId, TrainSample};

use super::plain::PlainNode;
use super::sockets;
use crate::rig::RigError;
use crate::rig::cores::{bind, prioritise};

/// The train of every latency case.
pub const TRAIN: TrainId = TrainId(1);

/// A process of a measurement; started by the measuring commands, not by people.
#[derive(Debug, Args)]
pub struct PeerArguments {
    #[command(subcommand)]
    peer: PeerKind,
}

#[derive(Debug, Subcommand)]
enum PeerKind {
    /// The daemon itself, as `dynocar run` starts it
    Daemon {
        /// Its configuration
        config: PathBuf,
    },
    /// Copies sample to snapshot on the daemon's channels, looking without pause
    Echo(ServerSite),
    /// The same, woken by a listener of the plain transport
    ListeningEcho(ServerSite),
    /// The estimator behind a Unix datagram socket
    UnixDatagram(ServerSite),
    /// The estimator behind a ZeroMQ socket
    #[cfg(feature = "zeromq")]
    ZeroMq(ServerSite),
}

impl PeerKind {
    /// The real-time priority asked for; the daemon has it from its configuration.
    fn priority(&self) -> Option<u8> {
        match self {
            PeerKind::Daemon { .. } => None,
            PeerKind::Echo(place) | PeerKind::ListeningEcho(place) => place.priority,
            PeerKind::UnixDatagram(place) => place.priority,
            #[cfg(feature = "zeromq")]
            PeerKind::ZeroMq(place) => place.priority,
        }
    }
}

#[derive(Debug, Args)]
struct ServerSite {
    /// The site's folder
    folder: PathBuf,
    /// The core to bind to
    #[arg(long)]
    core: Option<usize>,
    /// Real-time priority
    #[arg(long)]
    priority: Option<u8>,
    /// Wait in the kernel instead of looking without pause
    #[arg(long)]
    blocks: bool,
}

impl ServerSite {
    fn pin(&self) {
        if let Some(core) = self.core {
            bind(core);
        }
    }
}

/// Serves until killed; the daemon until it is asked to stop.
///
/// # Errors
///
/// When a channel, socket or configuration cannot be used.
pub fn serve(arguments: &PeerArguments) -> Result<(), RigError> {
    prioritise(arguments.peer.priority());
    match &arguments.peer {
        PeerKind::Daemon { config } => run_daemon(config),
        PeerKind::Echo(place) => {
            place.pin();
            echo(&Host::from_environment()?)
        }
        PeerKind::ListeningEcho(place) => {
            place.pin();
            echo_when_notified(&Host::from_environment()?, &place.folder)
        }
        PeerKind::UnixDatagram(place) => {
            place.pin();
            let pipeline = sockets::pipeline(&place.folder, TRAIN)?;
            sockets::serve_datagrams(&place.folder, pipeline, place.blocks)
        }
        #[cfg(feature = "zeromq")]
        PeerKind::ZeroMq(place) => {
            let pipeline = sockets::pipeline(&place.folder, TRAIN)?;
            super::zeromq::serve(&place.folder, pipeline, place.blocks, || place.pin())
        }
    }
}

fn run_daemon(config: &Path) -> Result<(), RigError> {
    let config = DaemonConfig::load(config).map_err(|error| RigError::Daemon(error.to_string()))?;
    dynocar::run::run(&config).map_err(|error| RigError::Daemon(error.to_string()))
}

/// The echo's ports and the snapshot it sends.
struct Echo {
    samples: Receiver<TrainSample>,
    snapshots: Sender<ParameterSnapshot>,
    snapshot: ParameterSnapshot,
}

impl Echo {
    fn open(host: &Host) -> Result<Self, RigError> {
        let transport = Transport::open(host, "dynocar-bench-echo")?;
        let mut snapshot = ParameterSnapshot::empty();
        snapshot.train_id = TRAIN.0;
        snapshot.epoch = monotonic_now_ns() as u64;
        snapshot.pipeline_kind = PipelineKind::Echo as u32;
        let snapshots = transport.sender(TRAIN)?;
        Ok(Echo { samples: transport.receiver(TRAIN)?, snapshots, snapshot })
    }

    /// True when there was a sample, and it has been answered.
    fn answer(&mut self) -> Result<bool, RigError> {
        let Some(sample) = self.samples.receive() else { return Ok(false) };
        self.snapshot.sequence += 1;
        self.snapshot.sample_sequence = sample.sequence;
        self.snapshot.sample_time_ns = sample.time_ns;
        self.snapshot.sample_published_ns = sample.published_ns;
        self.snapshots.send(&self.snapshot)?;
        Ok(true)
    }
}

fn echo(host: &Host) -> Result<(), RigError> {
    let mut echo = Echo::open(host)?;
    loop {
        if !echo.answer()? {
            std::hint::spin_loop();
        }
    }
}

fn echo_when_notified(host: &Host, folder: &Path) -> Result<(), RigError> {
    let mut echo = Echo::open(host)?;
    let listener = PlainNode::open(folder)?.listener()?;
    loop {
        listener.wait()?;
        while echo.answer()? {}
    }
}
