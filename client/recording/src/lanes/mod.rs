//! What a recorder and a live view read: one more reader of the trains' channels, which nobody waits
//! for.
//!
//! Samples are taken at least every few milliseconds, for a channel holds the newest 512 of them; what
//! is passed over is counted and told.

mod lane;

use std::time::{Duration, Instant};

use dynocar_client::{ChannelError, Host, Peer, Role, monotonic_now_ns};
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};

use crate::event::{Event, EventKind};
use lane::Lane;

/// How long a reader sleeps between two looks at the channels: at 1 kHz a buffer of 512 samples
/// leaves it a hundred times as long.
pub const PAUSE: Duration = Duration::from_millis(5);
/// How often it looks who is there.
const LOOK: Duration = Duration::from_millis(200);

/// Where that goes what is read: into a recording, to viewers.
pub trait Sink {
    /// Why nothing more is taken.
    type Error: From<ChannelError>;

    /// Takes a sample.
    ///
    /// # Errors
    ///
    /// When nothing more is taken; so for every other item.
    fn sample(&mut self, sample: &TrainSample) -> Result<(), Self::Error>;

    /// Takes a snapshot.
    ///
    /// # Errors
    ///
    /// As above.
    fn snapshot(&mut self, snapshot: &ParameterSnapshot) -> Result<(), Self::Error>;

    /// Takes an event.
    ///
    /// # Errors
    ///
    /// As above.
    fn event(&mut self, event: &Event) -> Result<(), Self::Error>;

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

/// What is to be read.
#[derive(Clone, Debug)]
pub struct Wanted {
    /// The run-time directory.
    pub host: Host,
    /// The trains; every train that is there or comes, when empty.
    pub trains: Vec<TrainId>,
    /// A pipeline's snapshot is taken when the last is so old, or its status is another.
    pub snapshot_interval: Duration,
}

/// The trains that are read.
pub struct Lanes {
    wanted: Wanted,
    name: &'static str,
    lanes: Vec<Lane>,
    looked: Option<Instant>,
}

impl Lanes {
    /// Opens the trains that were named; `name` is what the reader's places are called.
    ///
    /// # Errors
    ///
    /// When a channel cannot be opened or all its places are taken.
    pub fn open<S: Sink>(
        wanted: Wanted,
        name: &'static str,
        sink: &mut S,
    ) -> Result<Self, S::Error> {
        let named = wanted.trains.clone();
        let mut lanes = Lanes { wanted, name, lanes: Vec::new(), looked: None };
        named.into_iter().try_for_each(|train| lanes.add(train, sink))?;
        Ok(lanes)
    }

    /// The trains that are read by now.
    pub fn trains(&self) -> impl Iterator<Item = TrainId> {
        self.lanes.iter().map(Lane::train)
    }

    /// Hands on what has come, and looks from time to time who is there.
    ///
    /// # Errors
    ///
    /// When a newcomer's channels cannot be opened, or nothing more is taken.
    pub fn take<S: Sink>(&mut self, sink: &mut S) -> Result<(), S::Error> {
        self.lanes.iter_mut().try_for_each(|lane| lane.take(sink))?;
        if self.looked.is_some_and(|it| it.elapsed() < LOOK) {
            return Ok(());
        }
        if self.wanted.trains.is_empty() {
            self.add_newcomers(sink)?;
        }
        let host = &self.wanted.host;
        self.lanes.iter_mut().try_for_each(|lane| lane.look(host, sink))?;
        self.looked = Some(Instant::now());
        Ok(())
    }

    /// Opens the trains that a daemon serves or a controller drives by now.
    fn add_newcomers<S: Sink>(&mut self, sink: &mut S) -> Result<(), S::Error> {
        for role in [Role::Daemon, Role::Controller] {
            for train in Peer::trains(&self.wanted.host, role)? {
                if self.trains().all(|known| known != train) {
                    self.add(train, sink)?;
                }
            }
        }
        Ok(())
    }

    fn add<S: Sink>(&mut self, train: TrainId, sink: &mut S) -> Result<(), S::Error> {
        let Wanted { host, snapshot_interval, .. } = &self.wanted;
        self.lanes.push(Lane::open(host, train, *snapshot_interval, self.name)?);
        sink.opened(train)
    }
}

/// An event of a train, seen now.
pub fn event(train: TrainId, kind: EventKind, text: String) -> Event {
    Event {
        monotonic_ns: monotonic_now_ns(),
        train_id: train.0,
        kind: kind as i32,
        text,
        ..Default::default()
    }
}
