//! The processes that a case is measured against: the hidden command `peer`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use dynocar::config::DaemonConfig;
use dynocar_client::channel::{Receiver, Sender, Transport};
use dynocar_client::{Host, monotonic_now_ns};
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainSample};

use super::plain;
use super::sockets::{TRAIN, pipeline, serve_datagrams};
use crate::output::Failure;
use crate::rig::cores::{bind, prioritise};

/// A process of a measurement; started by the measuring commands, not by people.
#[derive(Debug, Args)]
pub struct PeerArguments {
    /// What it does
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

/// What a process of a measurement does.
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
pub fn serve(arguments: &PeerArguments) -> Result<(), Failure> {
    let PeerArguments { kind, place, core, priority, blocks } = arguments;
    prioritise(*priority);
    let pin = || core.iter().copied().for_each(bind);
    match kind {
        PeerKind::Daemon => Ok(dynocar::run::run(&DaemonConfig::load(place)?)?),
        #[cfg(feature = "zeromq")]
        PeerKind::Zeromq => super::zeromq::serve(place, pipeline(place)?, *blocks, pin),
        PeerKind::Echo => {
            pin();
            let host = Host::from_environment()?;
            let mut echo = Echo::open(&host)?;
            let wait: Box<dyn Fn() -> Result<(), Failure>> = match blocks {
                // Woken by a listener of the plain transport.
                true => {
                    let service = plain::service(&host, place)?;
                    let listener = service.listener_builder().create();
                    let listener = listener.map_err(plain::refused("listener"))?;
                    let wait = move || listener.blocking_wait(|_| {}).map(|_| ());
                    Box::new(move || wait().map_err(plain::refused("wait")))
                }
                false => Box::new(|| {
                    std::hint::spin_loop();
                    Ok(())
                }),
            };
            loop {
                wait()?;
                while echo.answer()? {}
            }
        }
        PeerKind::UnixDatagram => {
            pin();
            serve_datagrams(place, pipeline(place)?, *blocks)
        }
    }
}

/// The echo's ports and the snapshot it sends.
struct Echo {
    samples: Receiver<TrainSample>,
    snapshots: Sender<ParameterSnapshot>,
    snapshot: ParameterSnapshot,
}

impl Echo {
    fn open(host: &Host) -> Result<Self, Failure> {
        let transport = Transport::open(host, "dynocar-bench-echo")?;
        let mut snapshot = ParameterSnapshot::empty();
        snapshot.train_id = TRAIN.0;
        snapshot.epoch = monotonic_now_ns() as u64;
        snapshot.pipeline_kind = PipelineKind::Echo as u32;
        let snapshots = transport.sender(TRAIN)?;
        Ok(Echo { samples: transport.receiver(TRAIN)?, snapshots, snapshot })
    }

    /// True when there was a sample, and it has been answered.
    fn answer(&mut self) -> Result<bool, Failure> {
        let Some(sample) = self.samples.receive() else { return Ok(false) };
        self.snapshot.sequence += 1;
        self.snapshot.sample_sequence = sample.sequence;
        self.snapshot.sample_time_ns = sample.time_ns;
        self.snapshot.sample_published_ns = sample.published_ns;
        self.snapshots.send(&self.snapshot)?;
        Ok(true)
    }
}
