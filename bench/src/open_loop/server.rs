//! The processes that a case is measured against: the hidden command `peer`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use dynocar::config::DaemonConfig;
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainSample};
use dynocar_transport::channel::Transport;
use dynocar_transport::{Host, monotonic_now_ns};

use super::wire::{self, Datagrams, SocketEnd, TRAIN};
use crate::output::BenchError;
use crate::rig::cores::{bind, prioritise};

/// A process of a measurement; started by the measuring commands, not by people.
#[derive(Debug, Args)]
pub struct PeerArguments {
    /// Kind of the peer
    #[arg(value_enum)]
    kind: PeerKind,
    /// The site's folder, or the daemon's configuration
    place: PathBuf,
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

/// Role of a process of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PeerKind {
    /// The daemon itself, as `dynocar run` starts it
    Daemon,
    /// Copies sample to snapshot on the daemon's channels
    Echo,
    /// The estimator behind a Unix datagram socket
    UnixDatagram,
    /// The estimator behind a ZeroMQ socket
    #[cfg(feature = "zeromq")]
    Zeromq,
}

/// Serves until killed; the daemon until it is asked to stop.
///
/// # Errors
///
/// When a channel, socket or configuration cannot be used.
pub fn serve(arguments: &PeerArguments) -> Result<(), BenchError> {
    let PeerArguments { kind, place, core, priority, blocks } = arguments;
    prioritise(*priority);
    let pin = || core.iter().copied().for_each(bind);
    match kind {
        PeerKind::Daemon => Ok(dynocar::run::run(&DaemonConfig::load(place)?)?),
        PeerKind::Echo => {
            pin();
            echo(place, *blocks)
        }
        PeerKind::UnixDatagram => {
            let socket = Datagrams::open(place, SocketEnd::Server, *blocks)?;
            pin();
            wire::serve(place, socket)
        }
        #[cfg(feature = "zeromq")]
        PeerKind::Zeromq => {
            // The library's threads are not bound.
            let socket = super::zeromq::ZeroMq::open(place, SocketEnd::Server, *blocks)?;
            pin();
            wire::serve(place, socket)
        }
    }
}

/// Copies the number of a sample into a snapshot on the daemon's channels; `blocks` is woken by a listener of the plain
/// transport instead of looking without pause.
fn echo(place: &Path, blocks: bool) -> Result<(), BenchError> {
    let host = Host::from_environment()?;
    let transport = Transport::open(&host, "dynocar-bench-echo")?;
    let (snapshots, samples) = (transport.sender(TRAIN)?, transport.receiver(TRAIN)?);
    let listener = match blocks {
        true => {
            let listener = wire::service(&host, place)?.listener_builder().create();
            Some(listener.map_err(wire::refused("listener"))?)
        }
        false => None,
    };
    let mut snapshot = ParameterSnapshot::empty();
    snapshot.train_id = TRAIN.0;
    snapshot.epoch = monotonic_now_ns() as u64;
    snapshot.pipeline_kind = PipelineKind::Echo as u32;
    loop {
        match &listener {
            Some(it) => it.blocking_wait(|_| {}).map(|_| ()).map_err(wire::refused("wait"))?,
            None => std::hint::spin_loop(),
        }
        while let Some(sample) = samples.receive() {
            let sample: TrainSample = sample;
            snapshot.sequence += 1;
            snapshot.sample_sequence = sample.sequence;
            snapshot.sample_time_ns = sample.time_ns;
            snapshots.send(&snapshot)?;
        }
    }
}
