//! The controller's end of each transport.

use std::io::ErrorKind;
use std::os::unix::net::UnixDatagram;
use std::path::PathBuf;
use std::time::Duration;

use dynocar_client::channel::{Receiver, Sender, Transport};
use dynocar_client::{SamplePublisher, SnapshotReader, monotonic_now_ns};
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainId, TrainSample};
use dynocar_tests::process::Site;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::ipc;

use super::plain::{self, refused};
use super::server::{CLIENT_SOCKET, SERVER_SOCKET, as_bytes, from_bytes};
use crate::output::{Failure, during};

/// Sends samples, and counts how far the answers have come.
pub trait Link {
    /// Sends a sample; gives its sequence number.
    ///
    /// # Errors
    ///
    /// When the transport fails for good; a message that a full queue refuses is only lost.
    fn publish(&mut self, sample: &mut TrainSample) -> Result<u64, Failure>;

    /// The sequence number of the newest sample behind the polled pipeline's newest snapshot, 0
    /// when none has come.
    ///
    /// # Errors
    ///
    /// When the transport fails for good.
    fn poll(&mut self) -> Result<u64, Failure>;

    /// When the newest answered sample left, and when its answer did, in ns of the monotonic clock;
    /// `None` where the peer does not say so.
    fn stamps(&self) -> Option<(i64, i64)> {
        None
    }

    /// Takes what else has come, while no answer is awaited: other pipelines' snapshots, which a
    /// controller's next poll would find in its way.
    ///
    /// # Errors
    ///
    /// As [`Link::poll`].
    fn rest(&mut self) -> Result<(), Failure> {
        std::hint::spin_loop();
        Ok(())
    }
}

/// What a controller links: Dynocar's client library.
pub struct ClientLink {
    publisher: SamplePublisher,
    reader: SnapshotReader,
    pipeline: PipelineKind,
    answer: Answer,
}

/// How far the answers have come, and when sample and answer left.
#[derive(Clone, Copy, Debug, Default)]
struct Answer {
    newest: u64,
    left_ns: i64,
    answered_ns: i64,
}

impl Answer {
    fn of(snapshot: &ParameterSnapshot) -> Self {
        Answer {
            newest: snapshot.sample_sequence,
            left_ns: snapshot.sample_published_ns,
            answered_ns: snapshot.published_ns,
        }
    }

    fn stamps(&self) -> Option<(i64, i64)> {
        (self.answered_ns > 0).then_some((self.left_ns, self.answered_ns))
    }
}

impl ClientLink {
    /// Opens publisher and reader; the answers of one pipeline count.
    ///
    /// # Errors
    ///
    /// When a channel cannot be opened.
    pub fn open(site: &Site, train: TrainId, pipeline: PipelineKind) -> Result<Self, Failure> {
        let publisher = SamplePublisher::open(&site.host(), train)?;
        let reader = SnapshotReader::open(&site.host(), train)?;
        Ok(ClientLink { publisher, reader, pipeline, answer: Answer::default() })
    }
}

impl Link for ClientLink {
    fn publish(&mut self, sample: &mut TrainSample) -> Result<u64, Failure> {
        Ok(self.publisher.publish(sample)?)
    }

    fn poll(&mut self) -> Result<u64, Failure> {
        if self.reader.poll() > 0
            && let Some(reading) = self.reader.latest(self.pipeline, 0)
        {
            self.answer = Answer::of(reading.snapshot);
        }
        Ok(self.answer.newest)
    }

    fn stamps(&self) -> Option<(i64, i64)> {
        self.answer.stamps()
    }

    fn rest(&mut self) -> Result<(), Failure> {
        self.poll().map(|_| ())
    }
}

/// A transport that carries samples there and snapshots back, and counts nothing.
pub trait Wire {
    /// Sends a sample; one that a full queue refuses is lost.
    ///
    /// # Errors
    ///
    /// When the transport fails for good.
    fn send(&mut self, sample: &TrainSample) -> Result<(), Failure>;

    /// Takes one snapshot, if there is one.
    ///
    /// # Errors
    ///
    /// When the transport fails for good.
    fn receive(&mut self) -> Result<Option<ParameterSnapshot>, Failure>;
}

/// A wire whose samples are numbered here.
pub struct Numbered<W> {
    wire: W,
    sequence: u64,
    answer: Answer,
}

impl<W: Wire> Numbered<W> {
    /// Numbers from 1.
    pub fn new(wire: W) -> Self {
        Numbered { wire, sequence: 0, answer: Answer::default() }
    }
}

impl<W: Wire> Link for Numbered<W> {
    fn publish(&mut self, sample: &mut TrainSample) -> Result<u64, Failure> {
        self.sequence += 1;
        (sample.sequence, sample.published_ns) = (self.sequence, monotonic_now_ns());
        self.wire.send(sample)?;
        Ok(self.sequence)
    }

    fn poll(&mut self) -> Result<u64, Failure> {
        let newer = |it: &ParameterSnapshot| it.sample_sequence >= self.answer.newest;
        if let Some(snapshot) = self.wire.receive()?.filter(newer) {
            self.answer = Answer::of(&snapshot);
        }
        Ok(self.answer.newest)
    }

    fn stamps(&self) -> Option<(i64, i64)> {
        self.answer.stamps()
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
    pub fn open(site: &Site, train: TrainId) -> Result<Self, Failure> {
        let transport = Transport::open(&site.host(), "dynocar-bench")?;
        let service = plain::service(&site.host(), site.path())?;
        Ok(Notifying {
            sender: transport.sender(train)?,
            receiver: transport.receiver(train)?,
            notifier: service.notifier_builder().create().map_err(refused("notifier"))?,
        })
    }
}

impl Wire for Notifying {
    fn send(&mut self, sample: &TrainSample) -> Result<(), Failure> {
        self.sender.send(sample)?;
        self.notifier.notify().map(|_| ()).map_err(refused("notification"))
    }

    fn receive(&mut self) -> Result<Option<ParameterSnapshot>, Failure> {
        Ok(self.receiver.receive())
    }
}

/// How long a blocking receive waits before the schedule is looked at again.
pub(super) const BLOCK: Duration = Duration::from_millis(1);

/// Unix datagram sockets, as a user would write them.
pub struct Datagrams {
    socket: UnixDatagram,
    server: PathBuf,
}

impl Datagrams {
    /// Binds the controller's socket; `blocks` waits in the kernel for answers.
    ///
    /// # Errors
    ///
    /// When the system refuses it.
    pub fn open(site: &Site, blocks: bool) -> Result<Self, Failure> {
        let socket = UnixDatagram::bind(site.path().join(CLIENT_SOCKET)).map_err(during("bind"))?;
        socket.set_nonblocking(!blocks)?;
        socket.set_read_timeout(blocks.then_some(BLOCK))?;
        Ok(Datagrams { socket, server: site.path().join(SERVER_SOCKET) })
    }
}

impl Wire for Datagrams {
    fn send(&mut self, sample: &TrainSample) -> Result<(), Failure> {
        match self.socket.send_to(as_bytes(sample), &self.server) {
            Err(error) if !is_passing(error.kind()) => Err(during("sending a datagram")(error)),
            // Full, or the server does not listen yet: lost.
            _ => Ok(()),
        }
    }

    fn receive(&mut self) -> Result<Option<ParameterSnapshot>, Failure> {
        let mut bytes = [0; size_of::<ParameterSnapshot>()];
        match self.socket.recv(&mut bytes) {
            Ok(count) => Ok(from_bytes(&bytes[..count])),
            Err(error) if is_passing(error.kind()) => Ok(None),
            Err(error) => Err(during("receiving a datagram")(error)),
        }
    }
}

/// True for what a receiver or sender has to live with.
fn is_passing(kind: ErrorKind) -> bool {
    use ErrorKind::{ConnectionRefused, Interrupted, NotFound, TimedOut, WouldBlock};
    matches!(kind, WouldBlock | TimedOut | NotFound | ConnectionRefused | Interrupted)
}
