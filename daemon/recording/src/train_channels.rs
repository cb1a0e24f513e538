//! Reader of the trains' channels for a recorder and a live view: an additional reader, for which nobody waits.
//!
//! Samples are taken at least every few milliseconds, since a channel holds the newest 512 of them; samples that were
//! missed are counted and reported. A [`Sink`] receives the others.

use std::time::{Duration, Instant};

use dynocar::observing::{self, ObservedTrain, TrainChange};
use dynocar::output::report_line;
use dynocar_shared::services::{PIPELINES_MAX, SAMPLE_BUFFER};
use dynocar_shared::{TrainId, TrainSample};
use dynocar_transport::channel::{Receiver, Transport};
use dynocar_transport::{ChannelError, Host, Role, monotonic_now_ns};

use dynocar_mcap::event::{Event, EventKind};
use dynocar_mcap::topic::Message;

/// How long a reader sleeps between two looks at the channels: at 1 kHz a buffer of 512 samples
/// leaves it a hundred times as long.
pub const PAUSE: Duration = Duration::from_millis(5);
/// Time between two checks of who is there.
const LOOK: Duration = Duration::from_millis(200);

/// Selection of trains and pipelines to read.
#[derive(Clone, Debug)]
pub struct ChannelSelection {
    /// The trains.
    pub trains: observing::ObservedSelection,
    /// Least age of the last snapshot of a pipeline at which the next one is taken; one of another status is taken at
    /// once.
    pub snapshot_interval: Duration,
}

/// The trains that are read.
pub struct TrainChannels {
    wanted: ChannelSelection,
    name: &'static str,
    channels: Vec<TrainChannel>,
    looked: Option<Instant>,
}

impl TrainChannels {
    /// Opens the trains that were named; `name` identifies the reader's ports.
    ///
    /// # Errors
    ///
    /// When a channel cannot be opened or all its places are taken.
    pub fn open<S: Sink>(
        wanted: ChannelSelection,
        name: &'static str,
        sink: &mut S,
    ) -> Result<Self, S::Error> {
        let named = wanted.trains.trains.clone();
        let mut channels = TrainChannels { wanted, name, channels: Vec::new(), looked: None };
        named.into_iter().try_for_each(|train| channels.add(train, sink))?;
        Ok(channels)
    }

    /// Returns the trains that are read by now.
    pub fn trains(&self) -> impl Iterator<Item = TrainId> {
        self.channels.iter().map(TrainChannel::train)
    }

    /// Passes on the new messages, and checks from time to time who is there.
    ///
    /// # Errors
    ///
    /// When a newcomer's channels cannot be opened, or nothing more is taken.
    pub fn take<S: Sink>(&mut self, sink: &mut S) -> Result<(), S::Error> {
        self.channels.iter_mut().try_for_each(|channel| channel.take(sink))?;
        if self.looked.is_some_and(|it| it.elapsed() < LOOK) {
            return Ok(());
        }
        let is_known = |train| self.trains().any(|known| known == train);
        let roles = [Role::Daemon, Role::Controller];
        for train in self.wanted.trains.newcomers(&roles, is_known)? {
            self.add(train, sink)?;
        }
        let host = &self.wanted.trains.host;
        self.channels.iter_mut().try_for_each(|channel| channel.look(host, sink))?;
        self.looked = Some(Instant::now());
        Ok(())
    }

    fn add<S: Sink>(&mut self, train: TrainId, sink: &mut S) -> Result<(), S::Error> {
        let ChannelSelection { trains, snapshot_interval } = &self.wanted;
        let channel = TrainChannel::open(&trains.host, train, *snapshot_interval, self.name)?;
        self.channels.push(channel);
        sink.opened(train)
    }
}

/// Destination of the messages that are read: a recording, or viewers.
pub trait Sink {
    /// Why nothing more is taken.
    type Error: From<ChannelError>;

    /// Takes a message.
    ///
    /// # Errors
    ///
    /// When nothing more is taken; so for all else.
    fn take(&mut self, message: Message<'_>) -> Result<(), Self::Error>;

    /// The channels of a train are open.
    ///
    /// # Errors
    ///
    /// As above.
    fn opened(&mut self, _train: TrainId) -> Result<(), Self::Error> {
        Ok(())
    }

    /// A daemon of this process has come; the event follows.
    ///
    /// # Errors
    ///
    /// As above.
    fn daemon_came(&mut self, _train: TrainId, _process: u32) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// The most samples taken in a row, before the other trains have their turn.
const TURN: usize = 4 * SAMPLE_BUFFER;

/// Which snapshot of a pipeline was taken last, and when.
#[derive(Clone, Copy, Debug, Default)]
struct TakenSnapshot {
    epoch: u64,
    sequence: u64,
    taken_ns: i64,
}

/// One train: its channels, and the messages that were taken from them.
pub struct TrainChannel {
    observed: ObservedTrain,
    samples: Receiver<TrainSample>,
    /// Least time between two snapshots of a pipeline, in ns.
    interval_ns: i64,
    /// The newest sample's number.
    newest: Option<u64>,
    taken: [TakenSnapshot; PIPELINES_MAX],
    /// True when samples have come since it was last looked who is there.
    is_driven: bool,
    /// Samples passed over since that was last reported.
    lost: u64,
    /// After the port: the last user goes only when its ports are gone.
    _transport: Transport,
}

impl TrainChannel {
    /// Opens the channels of a train; `name` identifies their ports.
    ///
    /// # Errors
    ///
    /// When they cannot be opened or all their places are taken.
    pub fn open(
        host: &Host,
        train: TrainId,
        interval: Duration,
        name: &str,
    ) -> Result<Self, ChannelError> {
        let observed = ObservedTrain::open(host, train)?;
        let transport = Transport::open(host, name)?;
        let samples = transport.receiver::<TrainSample>(train)?;
        transport.reserve()?;
        Ok(TrainChannel {
            observed,
            samples,
            interval_ns: interval.as_nanos() as i64,
            newest: None,
            taken: [TakenSnapshot::default(); PIPELINES_MAX],
            is_driven: false,
            lost: 0,
            _transport: transport,
        })
    }

    /// Returns the train.
    pub fn train(&self) -> TrainId {
        self.observed.id
    }

    /// Passes on the new messages.
    ///
    /// # Errors
    ///
    /// When it is not taken.
    pub fn take<S: Sink>(&mut self, sink: &mut S) -> Result<(), S::Error> {
        for _ in 0..TURN {
            let Some(sample) = self.samples.receive() else { break };
            self.count(sample.sequence, sink)?;
            sink.take(Message::Sample(&sample))?;
            self.is_driven = true;
        }
        let (train, changes) = (self.train(), self.observed.poll());
        let now_ns = monotonic_now_ns();
        for reading in self.observed.readings(now_ns) {
            let it = reading.snapshot;
            let changes =
                changes.iter().filter(|change| change.pipeline == Some(it.pipeline_index));
            let taken = &mut self.taken[it.pipeline_index as usize];
            let is_other = (it.epoch, it.sequence) != (taken.epoch, taken.sequence);
            let is_due = is_other && now_ns - taken.taken_ns >= self.interval_ns;
            if is_due || changes.clone().any(|change| change.kind != EventKind::DaemonSilent) {
                sink.take(Message::Snapshot(it))?;
                *taken = TakenSnapshot { epoch: it.epoch, sequence: it.sequence, taken_ns: now_ns };
            }
            for change in changes {
                sink.take(Message::Event(&Event::new(train, change)))?;
            }
        }
        Ok(())
    }

    /// Counts the numbers that were passed over. A number that is not greater than the last is of a
    /// count that was begun anew.
    fn count<S: Sink>(&mut self, sequence: u64, sink: &mut S) -> Result<(), S::Error> {
        let missing = match self.newest.replace(sequence) {
            Some(newest) if sequence > newest => sequence - newest - 1,
            _ => return Ok(()),
        };
        if missing > 0 {
            self.lost += missing;
            let text = format!("samples {} to {} never came", sequence - missing, sequence - 1);
            let lost = Event::now(self.train(), EventKind::SamplesLost, text);
            sink.take(Message::Event(&Event { count: Some(missing), ..lost }))?;
        }
        Ok(())
    }

    /// Checks who is there, and reports the changes; the last messages of a peer that is gone come before that report.
    ///
    /// # Errors
    ///
    /// When it is not taken.
    pub fn look<S: Sink>(&mut self, host: &Host, sink: &mut S) -> Result<(), S::Error> {
        let train = self.train();
        if self.lost > 0 {
            let lost = std::mem::take(&mut self.lost);
            report_line(&format!("train {train}: {lost} samples lost"));
        }
        let was_driven = std::mem::take(&mut self.is_driven);
        let was_absent = self.observed.controller().is_none();
        let mut changes = Vec::new();
        match self.observed.look(host, &mut changes) {
            // The event says so; samples are recorded all the same.
            Err(ChannelError::IncompatiblePeer { .. }) => {}
            looked => looked?,
        }
        self.take(sink)?;
        let is_absent = self.observed.controller().is_none();
        // One that came and went between two looks is gone too.
        if was_driven && was_absent && is_absent {
            changes.push(TrainChange::new(EventKind::ControllerGone, "no controller".into()));
        }
        for change in changes {
            match change.kind {
                EventKind::ControllerGone => self.is_driven = false,
                EventKind::DaemonCame => {
                    let process = self.observed.daemon().map_or(0, |it| it.process_id);
                    sink.daemon_came(train, process)?;
                }
                _ => {}
            }
            sink.take(Message::Event(&Event::new(train, &change)))?;
        }
        Ok(())
    }
}
