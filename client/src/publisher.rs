//! The end into which a controller writes samples.

use std::time::{Duration, Instant};

use dynocar_shared::{TrainId, TrainSample};

use dynocar_transport::channel::{Owner, SampleCount, Sender, Transport, Waker};
use dynocar_transport::peer::{Peer, RoleLock};
use dynocar_transport::{ChannelError, Host, Role, SendRefused, monotonic_now_ns};

/// Time for which a publisher that is closed waits for the pipelines to take the samples on their way.
pub const CLOSE_PATIENCE: Duration = Duration::from_millis(200);
/// Time between two checks while it waits.
const PAUSE: Duration = Duration::from_millis(1);

/// Publishes one train's samples.
///
/// One controller drives a train: while a publisher lives, a second one for the same train is
/// refused. Sequence numbers go on from controller to controller. Dropping it waits for at most [`CLOSE_PATIENCE`],
/// unless [`SamplePublisher::flush`] has waited already; the daemon counts samples that were not taken by then as lost.
///
/// # Examples
///
/// ```
/// use dynocar_client::{Host, SamplePublisher, monotonic_now_ns};
/// use dynocar_shared::{SampleField, TrainId, TrainSample};
///
/// # let folder = tempfile::tempdir()?;
/// # let host = Host::at(&folder.path().join("root"))?;
/// let mut publisher = SamplePublisher::open(&host, TrainId(1))?;
/// let mut sample = TrainSample::empty(TrainId(1)).with(SampleField::Speed, 21.5);
/// sample.time_ns = monotonic_now_ns();
/// assert_eq!(publisher.publish(&mut sample)?, 1);
/// assert!(SamplePublisher::open(&host, TrainId(1)).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct SamplePublisher {
    host: Host,
    owner: Owner,
    train: TrainId,
    sender: Sender<TrainSample>,
    waker: Waker,
    count: SampleCount,
    /// The number before this publisher's first sample.
    start: u64,
    sequence: u64,
    /// The newest number when the pipelines were last waited for.
    flushed: u64,
    run: u32,
    /// Last, for the daemon takes a train that nobody drives as one of which nothing more comes.
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
        let count = SampleCount::open(host, train)?;
        transport.reserve()?;
        let start = count.begun();
        Ok(SamplePublisher {
            host: host.clone(),
            owner: Owner::current(),
            train,
            sender,
            waker,
            count,
            start,
            sequence: start,
            flushed: start,
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
    /// daemon counts the sample as lost. In a child that was forked since, nothing is done.
    ///
    /// # Real-time
    ///
    /// Never waits. No system call while the pipelines are awake and no process comes or goes;
    /// see [`Sender::send`](dynocar_transport::channel::Sender::send) for the one allocation.
    pub fn publish(&mut self, sample: &mut TrainSample) -> Result<u64, SendRefused> {
        // Before anything is written: the page and the numbers are the parent's in a forked child.
        if !self.owner.is_this_process() {
            return Err(SendRefused);
        }
        self.sequence += 1;
        sample.train_id = self.train.0;
        sample.sequence = self.sequence;
        sample.run = self.run;
        sample.published_ns = monotonic_now_ns();
        self.count.begin(self.sequence);
        let sent = self.sender.send(sample);
        self.count.finish(self.sequence);
        sent?;
        self.waker.wake(sample.published_ns);
        Ok(self.sequence)
    }

    /// Returns the number of samples that this publisher has published so far.
    pub fn published(&self) -> u64 {
        self.sequence - self.start
    }

    /// Sequence number of the newest sample, of this publisher or of one before it.
    pub fn sequence(&self) -> u64 {
        self.sequence
    }

    /// Returns the pipelines of the daemon that serves the train, or served it last.
    pub fn pipelines(&self) -> usize {
        self.count.pipelines()
    }

    /// Returns the samples of the train, of this publisher or of one before it, that the slowest pipeline thread
    /// has not taken; `None` where there never was one.
    pub fn untaken(&self) -> Option<u64> {
        self.count.untaken()
    }

    /// Waits until every pipeline has taken every sample, for at most `patience`; gives the number
    /// of this publisher's samples that the slowest has not taken, all of them where nobody ever
    /// served the train. A daemon that has died is not waited for.
    ///
    /// Not for the control cycle.
    pub fn flush(&mut self, patience: Duration) -> u64 {
        self.flushed = self.sequence;
        let start = Instant::now();
        loop {
            let untaken = self.untaken();
            let own = untaken.unwrap_or(u64::MAX).min(self.published());
            let is_hopeless = || {
                let daemon = Peer::look_up(&self.host, self.train, Role::Daemon);
                untaken.is_none() || !matches!(daemon, Ok(Peer::Compatible(_)))
            };
            if own == 0 || start.elapsed() >= patience || is_hopeless() {
                return own;
            }
            std::thread::sleep(PAUSE);
        }
    }
}

impl Drop for SamplePublisher {
    fn drop(&mut self) {
        if self.owner.is_this_process() && self.flushed != self.sequence {
            self.flush(CLOSE_PATIENCE);
        }
    }
}
