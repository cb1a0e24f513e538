//! The controller's end of each transport; a plain listener, with which Dynocar's own waking is compared; and the
//! alternatives: the same estimator behind sockets, whose messages are the bytes of samples and snapshots.

use std::io::ErrorKind;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use dynocar::dataset::load_train;
use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainId, TrainSample};
use dynocar_tests::process::DaemonSite;
use dynocar_transport::channel::{Payload, Receiver, Sender, Transport};
use dynocar_transport::{Host, monotonic_now_ns};
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{
    Config, FileName, NodeBuilder, Path as TransportPath, SemanticString, ServiceName,
    SignalHandlingMode, ipc,
};
use iceoryx2::service::port_factory::event::PortFactory;

use crate::output::{BenchError, during};
use crate::rig::default_pipeline;

/// A transport of samples to an estimator and of its answers back.
pub trait BenchTransport {
    /// Sends a numbered sample; a sample that a full queue refuses is lost.
    ///
    /// # Errors
    ///
    /// When the transport fails for good.
    fn send(&mut self, sample: &mut TrainSample) -> Result<(), BenchError>;

    /// Receives the answers that have come, and passes each to `hear`.
    ///
    /// # Errors
    ///
    /// When the transport fails for good.
    fn receive(&mut self, hear: &mut dyn FnMut(&ParameterSnapshot)) -> Result<(), BenchError>;

    /// Returns whether snapshots of other pipelines come too, which a controller's next poll takes first.
    fn carries_others(&self) -> bool {
        false
    }
}

/// The client library that a controller links.
pub struct Client {
    publisher: SamplePublisher,
    reader: SnapshotReader,
    polled: Option<PipelineKind>,
}

impl Client {
    /// Opens publisher and reader; the answers of one pipeline are heard, or of all.
    ///
    /// # Errors
    ///
    /// When a channel cannot be opened.
    pub fn open(
        site: &DaemonSite,
        train: TrainId,
        polled: Option<PipelineKind>,
    ) -> Result<Self, BenchError> {
        let publisher = SamplePublisher::open(&site.host(), train)?;
        Ok(Client { publisher, reader: SnapshotReader::open(&site.host(), train)?, polled })
    }
}

impl BenchTransport for Client {
    fn send(&mut self, sample: &mut TrainSample) -> Result<(), BenchError> {
        // It numbers by itself.
        Ok(self.publisher.publish(sample).map(|_| ())?)
    }

    fn receive(&mut self, hear: &mut dyn FnMut(&ParameterSnapshot)) -> Result<(), BenchError> {
        if self.reader.poll() > 0 {
            match self.polled {
                Some(kind) => self.reader.latest(kind, 0).iter().for_each(|it| hear(it.snapshot)),
                None => self.reader.readings(0).for_each(|it| hear(it.snapshot)),
            }
        }
        Ok(())
    }

    fn carries_others(&self) -> bool {
        true
    }
}

/// The plain transport with a notification for every sample: the floor of the event strategy.
pub struct Notifying {
    sender: Sender<TrainSample>,
    receiver: Receiver<ParameterSnapshot>,
    notifier: Notifier<ipc::Service>,
}

impl Notifying {
    /// Opens the ports.
    ///
    /// # Errors
    ///
    /// When the transport refuses one.
    pub fn open(site: &DaemonSite, train: TrainId) -> Result<Self, BenchError> {
        let transport = Transport::open(&site.host(), "dynocar-bench")?;
        let service = service(&site.host(), site.path())?;
        Ok(Notifying {
            sender: transport.sender(train)?,
            receiver: transport.receiver(train)?,
            notifier: service.notifier_builder().create().map_err(refused("notifier"))?,
        })
    }
}

impl BenchTransport for Notifying {
    fn send(&mut self, sample: &mut TrainSample) -> Result<(), BenchError> {
        self.sender.send(sample)?;
        self.notifier.notify().map(|_| ()).map_err(refused("notification"))
    }

    fn receive(&mut self, hear: &mut dyn FnMut(&ParameterSnapshot)) -> Result<(), BenchError> {
        self.receiver.receive().iter().for_each(hear);
        Ok(())
    }
}

/// Returns the failure for a refusal of the transport.
pub fn refused<E: std::fmt::Debug>(what: &'static str) -> impl FnOnce(E) -> BenchError {
    move |error| format!("iceoryx2 refused a {what}: {error:?}").into()
}

/// Returns the service of the plain transport that notifies and listens within a measurement's folder.
///
/// # Errors
///
/// When the transport refuses.
pub fn service(host: &Host, folder: &Path) -> Result<PortFactory<ipc::Service>, BenchError> {
    let mut config = Config::default();
    let own = host.segment_prefix();
    config.global.prefix = FileName::new(own.as_bytes()).map_err(refused("name"))?;
    let root = folder.join("plain");
    let root = TransportPath::new(root.as_os_str().as_encoded_bytes());
    config.global.set_root_path(&root.map_err(refused("folder"))?);
    let node = NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<ipc::Service>()
        .map_err(refused("node"))?;
    let name = ServiceName::new("dynocar-bench/notify").map_err(refused("service name"))?;
    node.service_builder(&name).event().open_or_create().map_err(refused("service"))
}

/// The train of every latency case.
pub const TRAIN: TrainId = TrainId(1);
/// The pipeline that is compared with the floor and the alternatives.
pub const COMPARED: PipelineKind = PipelineKind::RegularisedRls;
/// How long a blocking receive waits before anything else is looked at again.
pub(super) const BLOCK: Duration = Duration::from_millis(1);

/// The two ends of a socket.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SocketEnd {
    /// Sends samples.
    Controller,
    /// Answers them.
    Server,
}

/// An end of a socket that carries whole messages.
pub trait Socket {
    /// Sends a message to the reader; a message that is not taken is lost.
    ///
    /// # Errors
    ///
    /// When the socket fails for good.
    fn send(&mut self, bytes: &[u8]) -> Result<(), BenchError>;

    /// Returns the length of a message that has come.
    ///
    /// # Errors
    ///
    /// When the socket fails for good.
    fn receive(&mut self, bytes: &mut [u8]) -> Result<Option<usize>, BenchError>;
}

impl<S: Socket> BenchTransport for S {
    fn send(&mut self, sample: &mut TrainSample) -> Result<(), BenchError> {
        Socket::send(self, as_bytes(sample))
    }

    fn receive(&mut self, hear: &mut dyn FnMut(&ParameterSnapshot)) -> Result<(), BenchError> {
        take::<ParameterSnapshot>(self)?.iter().for_each(hear);
        Ok(())
    }
}

/// Answers samples until killed, with the estimator and the train's file as the daemon has them.
///
/// # Errors
///
/// When the socket fails for good, or the train's file is wrong.
pub fn serve(folder: &Path, mut socket: impl Socket) -> Result<(), BenchError> {
    let train = Arc::new(load_train(&folder.join("train.toml"))?);
    let mut pipeline = default_pipeline(COMPARED, TRAIN, &train, None);
    loop {
        let Some(sample) = take::<TrainSample>(&mut socket)? else {
            std::hint::spin_loop();
            continue;
        };
        pipeline.process(&sample);
        let snapshot = pipeline.snapshot_mut();
        snapshot.published_ns = monotonic_now_ns();
        Socket::send(&mut socket, as_bytes(snapshot))?;
    }
}

/// Returns the payload of a message that has come, if it is as long as one.
fn take<T: Payload>(socket: &mut impl Socket) -> Result<Option<T>, BenchError> {
    // No payload is longer.
    let mut bytes = [0; size_of::<ParameterSnapshot>()];
    let count = Socket::receive(socket, &mut bytes[..size_of::<T>()])?;
    Ok(count.and_then(|count| from_bytes(&bytes[..count])))
}

/// Returns the bytes of a payload.
fn as_bytes<T: Payload>(payload: &T) -> &[u8] {
    // SAFETY: a payload is a `repr(C)` struct of plain numbers without padding (checked when it
    // is compiled), so that every one of its bytes is initialised.
    unsafe { std::slice::from_raw_parts(std::ptr::from_ref(payload).cast(), size_of::<T>()) }
}

/// Returns a payload from its bytes; `None` when they are too few or too many.
fn from_bytes<T: Payload>(bytes: &[u8]) -> Option<T> {
    if bytes.len() != size_of::<T>() {
        return None;
    }
    // SAFETY: the length is right, every pattern of bytes is a value of a struct of plain
    // numbers, and the read does not ask for alignment.
    Some(unsafe { std::ptr::read_unaligned(bytes.as_ptr().cast()) })
}

/// Unix datagram sockets, as a user would write them.
pub struct Datagrams {
    socket: UnixDatagram,
    peer: PathBuf,
}

impl Datagrams {
    /// Binds an end in a site's folder; `blocks` waits in the kernel for messages.
    ///
    /// # Errors
    ///
    /// When the system refuses it.
    pub fn open(folder: &Path, end: SocketEnd, blocks: bool) -> Result<Self, BenchError> {
        let mut names = ["controller.socket", "server.socket"].map(|name| folder.join(name));
        if end == SocketEnd::Server {
            names.reverse();
        }
        let [own, peer] = names;
        let socket = UnixDatagram::bind(own).map_err(during("bind"))?;
        socket.set_nonblocking(!blocks)?;
        socket.set_read_timeout(blocks.then_some(BLOCK))?;
        // Two ends with full queues would wait for each other for ever.
        socket.set_write_timeout(blocks.then_some(BLOCK))?;
        Ok(Datagrams { socket, peer })
    }
}

impl Socket for Datagrams {
    fn send(&mut self, bytes: &[u8]) -> Result<(), BenchError> {
        // Full, or the peer does not listen yet: lost.
        unless_passing(self.socket.send_to(bytes, &self.peer)).map(|_| ())
    }

    fn receive(&mut self, bytes: &mut [u8]) -> Result<Option<usize>, BenchError> {
        unless_passing(self.socket.recv(bytes))
    }
}

/// Returns the result of a call, or `None` for errors that a receiver or sender has to tolerate.
fn unless_passing(result: std::io::Result<usize>) -> Result<Option<usize>, BenchError> {
    use ErrorKind::{ConnectionRefused, Interrupted, NotFound, TimedOut, WouldBlock};
    match result.map_err(|error| (error.kind(), error)) {
        Ok(count) => Ok(Some(count)),
        Err((WouldBlock | TimedOut | NotFound | ConnectionRefused | Interrupted, _)) => Ok(None),
        Err((_, error)) => Err(during("a datagram")(error)),
    }
}

#[cfg(test)]
mod tests {
    use dynocar_shared::{SampleField, TrainId, TrainSample};

    use super::*;

    #[test]
    fn a_sample_survives_its_bytes() {
        let sample = TrainSample::empty(TrainId(7)).with(SampleField::Speed, 21.5);
        assert_eq!(from_bytes::<TrainSample>(as_bytes(&sample)), Some(sample));
        assert_eq!(from_bytes::<TrainSample>(&as_bytes(&sample)[1..]), None);
    }
    #[test]
    fn ends_that_do_not_read_lose_messages_and_wait_for_each_other_no_longer_than_a_moment() {
        let folder = tempfile::tempdir().unwrap();
        let open = |end| Datagrams::open(folder.path(), end, true).unwrap();
        let mut ends = [open(SocketEnd::Controller), open(SocketEnd::Server)];
        // More than the kernel queues, 10 unless the system says otherwise.
        let capacity: usize = std::fs::read_to_string("/proc/sys/net/unix/max_dgram_qlen")
            .map_or(10, |text| text.trim().parse().unwrap());
        for _ in 0..capacity + 5 {
            ends.iter_mut().for_each(|end| Socket::send(end, &[0; 8]).unwrap());
        }
        let received =
            std::iter::from_fn(|| Socket::receive(&mut ends[0], &mut [0; 8]).unwrap()).count();
        assert!((1..capacity + 5).contains(&received), "{received} of {capacity}");
    }
}
