//! The controller's end of each transport.

use std::io::ErrorKind;
use std::os::unix::net::UnixDatagram;
use std::time::Duration;

use dynocar_client::channel::{Receiver, Sender, Transport};
use dynocar_client::{SamplePublisher, SnapshotReader, monotonic_now_ns};
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainId, TrainSample};

use super::bytes::{as_bytes, from_bytes};
use super::plain::{PlainNode, PlainNotifier};
use super::sockets::{CLIENT_SOCKET, SERVER_SOCKET};
use crate::rig::site::Site;
use crate::rig::{RigError, system};

/// Sends samples, and counts how far the answers have come.
pub trait Link {
    /// Sends a sample; gives its sequence number.
    ///
    /// # Errors
    ///
    /// When the transport fails for good; a message that a full queue refuses is only lost.
    fn publish(&mut self, sample: &mut TrainSample) -> Result<u64, RigError>;

    /// The sequence number of the newest sample behind the polled pipeline's newest snapshot, 0
    /// when none has come.
    ///
    /// # Errors
    ///
    /// When the transport fails for good.
    fn poll(&mut self) -> Result<u64, RigError>;

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
    fn rest(&mut self) -> Result<(), RigError> {
        std::hint::spin_loop();
        Ok(())
    }
}

/// What a controller links: Dynocar's client library.
pub struct ClientLink {
    publisher: SamplePublisher,
    reader: SnapshotReader,
    pipeline: PipelineKind,
    newest: u64,
    stamps: (i64, i64),
}

impl ClientLink {
    /// Opens publisher and reader; the answers of one pipeline count.
    ///
    /// # Errors
    ///
    /// When a channel cannot be opened.
    pub fn open(site: &Site, train: TrainId, pipeline: PipelineKind) -> Result<Self, RigError> {
        let publisher = SamplePublisher::open(site.host(), train)?;
        let reader = SnapshotReader::open(site.host(), train)?;
        Ok(ClientLink { publisher, reader, pipeline, newest: 0, stamps: (0, 0) })
    }
}

impl Link for ClientLink {
    fn publish(&mut self, sample: &mut TrainSample) -> Result<u64, RigError> {
        Ok(self.publisher.publish(sample)?)
    }

    fn poll(&mut self) -> Result<u64, RigError> {
        if self.reader.poll() > 0
            && let Some(reading) = self.reader.latest(self.pipeline, 0)
        {
            self.newest = reading.snapshot.sample_sequence;
            self.stamps = (reading.snapshot.sample_published_ns, reading.snapshot.published_ns);
        }
        Ok(self.newest)
    }

    fn stamps(&self) -> Option<(i64, i64)> {
        (self.stamps.1 > 0).then_some(self.stamps)
    }

    fn rest(&mut self) -> Result<(), RigError> {
        self.poll().map(|_| ())
    }
}

/// The plain transport with a notification for every sample: the floor of the event strategy.
pub struct NotifyingLink {
    sender: Sender<TrainSample>,
    receiver: Receiver<ParameterSnapshot>,
    notifier: PlainNotifier,
    _node: PlainNode,
    sequence: u64,
    newest: u64,
}

impl NotifyingLink {
    /// Opens the ports.
    ///
    /// # Errors
    ///
    /// When the transport refuses one.
    pub fn open(site: &Site, train: TrainId) -> Result<Self, RigError> {
        let transport = Transport::open(site.host(), "dynocar-bench")?;
        let node = PlainNode::open(site.path())?;
        Ok(NotifyingLink {
            sender: transport.sender(train)?,
            receiver: transport.receiver(train)?,
            notifier: node.notifier()?,
            _node: node,
            sequence: 0,
            newest: 0,
        })
    }
}

impl Link for NotifyingLink {
    fn publish(&mut self, sample: &mut TrainSample) -> Result<u64, RigError> {
        self.sequence += 1;
        sample.sequence = self.sequence;
        self.sender.send(sample)?;
        self.notifier.notify()?;
        Ok(self.sequence)
    }

    fn poll(&mut self) -> Result<u64, RigError> {
        while let Some(snapshot) = self.receiver.receive() {
            self.newest = snapshot.sample_sequence;
        }
        Ok(self.newest)
    }
}

/// How long a blocking receive waits before the schedule is looked at again.
pub(super) const BLOCK: Duration = Duration::from_millis(1);

/// Unix datagram sockets, as a user would write them.
pub struct DatagramLink {
    socket: UnixDatagram,
    server: std::path::PathBuf,
    sequence: u64,
    newest: u64,
    stamps: (i64, i64),
}

impl DatagramLink {
    /// Binds the controller's socket; `blocks` waits in the kernel for answers instead of
    /// asking again and again.
    ///
    /// # Errors
    ///
    /// When the system refuses the socket.
    pub fn open(site: &Site, blocks: bool) -> Result<Self, RigError> {
        let socket = UnixDatagram::bind(site.path().join(CLIENT_SOCKET)).map_err(system("bind"))?;
        socket.set_nonblocking(!blocks).map_err(system("socket mode"))?;
        socket.set_read_timeout(blocks.then_some(BLOCK)).map_err(system("socket timeout"))?;
        let server = site.path().join(SERVER_SOCKET);
        Ok(DatagramLink { socket, server, sequence: 0, newest: 0, stamps: (0, 0) })
    }
}

impl Link for DatagramLink {
    fn publish(&mut self, sample: &mut TrainSample) -> Result<u64, RigError> {
        self.sequence += 1;
        sample.sequence = self.sequence;
        sample.published_ns = monotonic_now_ns();
        match self.socket.send_to(as_bytes(sample), &self.server) {
            Ok(_) => Ok(self.sequence),
            // Full, or the server does not listen yet: lost.
            Err(error) if is_passing(error.kind()) => Ok(self.sequence),
            Err(error) => Err(system("sending a datagram")(error)),
        }
    }

    fn poll(&mut self) -> Result<u64, RigError> {
        let mut bytes = [0; size_of::<ParameterSnapshot>()];
        match self.socket.recv(&mut bytes) {
            Ok(count) => {
                if let Some(snapshot) = from_bytes::<ParameterSnapshot>(&bytes[..count]) {
                    self.newest = self.newest.max(snapshot.sample_sequence);
                    self.stamps = (snapshot.sample_published_ns, snapshot.published_ns);
                }
            }
            Err(error) if is_passing(error.kind()) => {}
            Err(error) => return Err(system("receiving a datagram")(error)),
        }
        Ok(self.newest)
    }

    fn stamps(&self) -> Option<(i64, i64)> {
        (self.stamps.1 > 0).then_some(self.stamps)
    }
}

fn is_passing(kind: ErrorKind) -> bool {
    matches!(
        kind,
        ErrorKind::WouldBlock
            | ErrorKind::TimedOut
            | ErrorKind::NotFound
            | ErrorKind::ConnectionRefused
            | ErrorKind::Interrupted
    )
}
