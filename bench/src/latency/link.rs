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
use super::sockets::{CLIENT_SOCKET, SERVER_SOCKET, as_bytes, from_bytes};
use crate::output::{Failure, during};

/// A transport that carries samples there and answers back.
pub trait Wire {
    /// Sends a sample, which has a number; one that a full queue refuses is lost.
    ///
    /// # Errors
    ///
    /// When the transport fails for good.
    fn send(&mut self, sample: &mut TrainSample) -> Result<(), Failure>;

    /// Takes one answer, if there is one.
    ///
    /// # Errors
    ///
    /// When the transport fails for good.
    fn receive(&mut self) -> Result<Option<Answer>, Failure>;

    /// True where other pipelines' snapshots come, too, which a controller's next poll would find in its way.
    fn carries_others(&self) -> bool {
        false
    }
}

/// How far the answers have come, and when, in ns of the monotonic clock, the newest answered sample and its answer
/// left.
#[derive(Clone, Copy, Debug, Default)]
pub struct Answer {
    /// Number of the newest sample behind the snapshot.
    pub newest: u64,
    /// When that sample left.
    pub left_ns: i64,
    /// When the snapshot left.
    pub answered_ns: i64,
}

impl From<&ParameterSnapshot> for Answer {
    fn from(snapshot: &ParameterSnapshot) -> Self {
        Answer {
            newest: snapshot.sample_sequence,
            left_ns: snapshot.sample_published_ns,
            answered_ns: snapshot.published_ns,
        }
    }
}

/// A controller that numbers its samples, and counts how far the answers have come.
pub struct Controller {
    wire: Box<dyn Wire>,
    sequence: u64,
    answer: Answer,
}

impl Controller {
    /// A controller that has sent nothing.
    pub fn new(wire: impl Wire + 'static) -> Self {
        Controller { wire: Box::new(wire), sequence: 0, answer: Answer::default() }
    }

    /// Sends a sample; gives its number.
    ///
    /// # Errors
    ///
    /// As [`Wire::send`].
    pub fn publish(&mut self, sample: &mut TrainSample) -> Result<u64, Failure> {
        (sample.sequence, sample.published_ns) = (self.sequence + 1, monotonic_now_ns());
        self.wire.send(sample)?;
        self.sequence = sample.sequence;
        Ok(self.sequence)
    }

    /// The number of the newest answered sample, 0 when none has been.
    ///
    /// # Errors
    ///
    /// As [`Wire::receive`].
    pub fn poll(&mut self) -> Result<u64, Failure> {
        let newer = |it: &Answer| it.newest >= self.answer.newest;
        if let Some(answer) = self.wire.receive()?.filter(newer) {
            self.answer = answer;
        }
        Ok(self.answer.newest)
    }

    /// When the newest answered sample left, and when its answer did; `None` where the peer does not say so.
    pub fn stamps(&self) -> Option<(i64, i64)> {
        let Answer { left_ns, answered_ns, .. } = self.answer;
        (answered_ns > 0).then_some((left_ns, answered_ns))
    }

    /// Takes what else has come, while no answer is awaited.
    ///
    /// # Errors
    ///
    /// As [`Wire::receive`].
    pub fn rest(&mut self) -> Result<(), Failure> {
        if self.wire.carries_others() {
            return self.poll().map(|_| ());
        }
        std::hint::spin_loop();
        Ok(())
    }
}

/// What a controller links: Dynocar's client library.
pub struct Client {
    publisher: SamplePublisher,
    reader: SnapshotReader,
    pipeline: PipelineKind,
}

impl Client {
    /// Opens publisher and reader; the answers of one pipeline count.
    ///
    /// # Errors
    ///
    /// When a channel cannot be opened.
    pub fn open(site: &Site, train: TrainId, pipeline: PipelineKind) -> Result<Self, Failure> {
        let publisher = SamplePublisher::open(&site.host(), train)?;
        Ok(Client { publisher, reader: SnapshotReader::open(&site.host(), train)?, pipeline })
    }
}

impl Wire for Client {
    fn send(&mut self, sample: &mut TrainSample) -> Result<(), Failure> {
        // It numbers by itself.
        Ok(self.publisher.publish(sample).map(|_| ())?)
    }

    fn receive(&mut self) -> Result<Option<Answer>, Failure> {
        let has_news = self.reader.poll() > 0;
        let latest = self.reader.latest(self.pipeline, 0).filter(|_| has_news);
        Ok(latest.map(|reading| reading.snapshot.into()))
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
    fn send(&mut self, sample: &mut TrainSample) -> Result<(), Failure> {
        self.sender.send(sample)?;
        self.notifier.notify().map(|_| ()).map_err(refused("notification"))
    }

    fn receive(&mut self) -> Result<Option<Answer>, Failure> {
        Ok(self.receiver.receive().as_ref().map(Answer::from))
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
    fn send(&mut self, sample: &mut TrainSample) -> Result<(), Failure> {
        match self.socket.send_to(as_bytes(sample), &self.server) {
            Err(error) if !is_passing(error.kind()) => Err(during("sending a datagram")(error)),
            // Full, or the server does not listen yet: lost.
            _ => Ok(()),
        }
    }

    fn receive(&mut self) -> Result<Option<Answer>, Failure> {
        let mut bytes = [0; size_of::<ParameterSnapshot>()];
        match self.socket.recv(&mut bytes) {
            Ok(count) => Ok(snapshot(&bytes[..count])),
            Err(error) if is_passing(error.kind()) => Ok(None),
            Err(error) => Err(during("receiving a datagram")(error)),
        }
    }
}

/// The answer in the bytes of a snapshot.
pub(super) fn snapshot(bytes: &[u8]) -> Option<Answer> {
    from_bytes::<ParameterSnapshot>(bytes).as_ref().map(Answer::from)
}

/// True for what a receiver or sender has to live with.
fn is_passing(kind: ErrorKind) -> bool {
    use ErrorKind::{ConnectionRefused, Interrupted, NotFound, TimedOut, WouldBlock};
    matches!(kind, WouldBlock | TimedOut | NotFound | ConnectionRefused | Interrupted)
}
