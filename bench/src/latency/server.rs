//! The processes that a case is measured against: the hidden command `peer`.

use std::io::ErrorKind;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, ValueEnum};
use dynocar::config::DaemonConfig;
use dynocar::dataset::load_train;
use dynocar_client::channel::{Payload, Receiver, Sender, Transport};
use dynocar_client::{Host, monotonic_now_ns};
use dynocar_core::pipeline::Pipeline;
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainId, TrainSample};

use super::plain;
use crate::output::{Failure, during};
use crate::rig::cores::{bind, prioritise};
use crate::rig::pipelines::default_pipeline;

/// The train of every latency case.
pub const TRAIN: TrainId = TrainId(1);

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

/// The pipeline that is compared with the floor and the alternatives.
pub const COMPARED: PipelineKind = PipelineKind::RegularisedRls;
/// The controller's socket, in the site's folder.
pub const CLIENT_SOCKET: &str = "client.socket";
/// The server's socket, in the site's folder.
pub const SERVER_SOCKET: &str = "server.socket";

/// The estimator that every alternative runs, as the daemon builds it.
///
/// # Errors
///
/// When the train's file or a setting is wrong.
fn pipeline(folder: &Path) -> Result<Pipeline, Failure> {
    let model = Arc::new(load_train(&folder.join("train.toml"))?);
    Ok(default_pipeline(COMPARED, TRAIN, &model, None))
}

pub(super) fn answer<'a>(
    pipeline: &'a mut Pipeline,
    sample: &TrainSample,
) -> &'a ParameterSnapshot {
    pipeline.process(sample);
    let snapshot = pipeline.snapshot_mut();
    snapshot.published_ns = monotonic_now_ns();
    snapshot
}

/// Answers datagrams until killed; `blocks` waits in the kernel instead of asking again.
///
/// # Errors
///
/// When the system refuses the socket.
fn serve_datagrams(folder: &Path, mut pipeline: Pipeline, blocks: bool) -> Result<(), Failure> {
    let socket = UnixDatagram::bind(folder.join(SERVER_SOCKET)).map_err(during("bind"))?;
    socket.set_nonblocking(!blocks)?;
    let client = folder.join(CLIENT_SOCKET);
    let mut bytes = [0; size_of::<TrainSample>()];
    loop {
        match socket.recv(&mut bytes) {
            Ok(count) => {
                let Some(sample) = from_bytes::<TrainSample>(&bytes[..count]) else { continue };
                // A controller that does not read loses its answer.
                let _ = socket.send_to(as_bytes(answer(&mut pipeline, &sample)), &client);
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => std::hint::spin_loop(),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(during("receiving a datagram")(error)),
        }
    }
}

/// The bytes of a payload.
pub fn as_bytes<T: Payload>(payload: &T) -> &[u8] {
    // SAFETY: a payload is a `repr(C)` struct of plain numbers without padding (checked when it
    // is compiled), so that every one of its bytes is initialised.
    unsafe { std::slice::from_raw_parts(std::ptr::from_ref(payload).cast(), size_of::<T>()) }
}

/// A payload from its bytes; `None` when they are too few or too many.
pub fn from_bytes<T: Payload>(bytes: &[u8]) -> Option<T> {
    if bytes.len() != size_of::<T>() {
        return None;
    }
    // SAFETY: the length is right, every pattern of bytes is a value of a struct of plain
    // numbers, and the read does not ask for alignment.
    Some(unsafe { std::ptr::read_unaligned(bytes.as_ptr().cast()) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_shared::{SampleField, TrainId, TrainSample};

    #[test]
    fn a_sample_survives_its_bytes() {
        let sample = TrainSample::empty(TrainId(7)).with(SampleField::Speed, 21.5);
        assert_eq!(from_bytes::<TrainSample>(as_bytes(&sample)), Some(sample));
        assert_eq!(from_bytes::<TrainSample>(&as_bytes(&sample)[1..]), None);
    }
}
