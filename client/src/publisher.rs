//! The end a controller writes samples into.

use dynocar_shared::{TrainId, TrainSample};

use crate::channel::{SendRefused, Sender, Transport, Waker};
use crate::clock::monotonic_now_ns;
use crate::error::ChannelError;
use crate::host::Host;
use crate::peer::{Peer, Role, RoleLock};

/// Publishes one train's samples.
///
/// One controller drives a train: while a publisher lives, a second one for the same train is
/// refused.
#[derive(Debug)]
pub struct SamplePublisher {
    train: TrainId,
    sender: Sender<TrainSample>,
    waker: Waker,
    sequence: u64,
    run: u32,
    _role: RoleLock,
}

impl SamplePublisher {
    /// Opens the sample channel of a train. The daemon need not run yet.
    ///
    /// # Errors
    ///
    /// When another process drives the train, when the daemon there is incompatible, or when
    /// the shared memory cannot be used.
    pub fn open(host: &Host, train: TrainId) -> Result<Self, ChannelError> {
        let role = RoleLock::claim(host, train, Role::Controller)?;
        Peer::look_up(host, train, Role::Daemon)?.require_compatible(train, Role::Controller)?;
        let transport = Transport::open(host, "dynocar-controller")?;
        let sender = transport.sender::<TrainSample>(train)?;
        let waker = Waker::open(&transport, train)?;
        transport.reserve()?;
        Ok(SamplePublisher {
            train,
            sender,
            waker,
            sequence: 0,
            // Milliseconds since boot: a restarted controller never repeats its last run.
            run: (monotonic_now_ns() / 1_000_000) as u32,
            _role: role,
        })
    }

    /// Starts a new run (trip): filters do not integrate across.
    pub fn start_run(&mut self) {
        self.run = self.run.wrapping_add(1);
    }

    /// Publishes a sample; fills in train, sequence number, run and time of publishing.
    /// Gives the sequence number.
    ///
    /// # Errors
    ///
    /// When the transport takes no message. The number is spent all the same, so that the
    /// daemon counts the sample as lost.
    ///
    /// # Real-time
    ///
    /// Never waits. No system call while the pipelines are awake and no process comes or goes;
    /// see [`Sender::send`](crate::channel::Sender::send) for the one allocation.
    pub fn publish(&mut self, sample: &mut TrainSample) -> Result<u64, SendRefused> {
        self.sequence += 1;
        sample.train_id = self.train.0;
        sample.sequence = self.sequence;
        sample.run = self.run;
        sample.published_ns = monotonic_now_ns();
        self.sender.send(sample)?;
        self.waker.wake(sample.published_ns);
        Ok(self.sequence)
    }

    /// Number of samples published so far.
    pub fn published(&self) -> u64 {
        self.sequence
    }
}
