//! What a recorder and a live view read: one more reader of the trains' channels, which nobody waits
//! for.
//!
//! Samples are taken at least every few milliseconds, for a channel holds the newest 512 of them; what
//! is passed over is counted and reported.

mod sink;
mod train_channel;

use std::time::{Duration, Instant};

use dynocar::observing;
use dynocar_client::Role;
use dynocar_shared::TrainId;

pub use sink::Sink;
use train_channel::TrainChannel;

/// How long a reader sleeps between two looks at the channels: at 1 kHz a buffer of 512 samples
/// leaves it a hundred times as long.
pub const PAUSE: Duration = Duration::from_millis(5);
/// How often it looks who is there.
const LOOK: Duration = Duration::from_millis(200);

/// What is to be read.
#[derive(Clone, Debug)]
pub struct Wanted {
    /// The trains.
    pub trains: observing::Wanted,
    /// A pipeline's snapshot is taken when the last is so old, or its status is another.
    pub snapshot_interval: Duration,
}

/// The trains that are read.
pub struct TrainChannels {
    wanted: Wanted,
    name: &'static str,
    channels: Vec<TrainChannel>,
    looked: Option<Instant>,
}

impl TrainChannels {
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
        let named = wanted.trains.trains.clone();
        let mut channels = TrainChannels { wanted, name, channels: Vec::new(), looked: None };
        named.into_iter().try_for_each(|train| channels.add(train, sink))?;
        Ok(channels)
    }

    /// The trains that are read by now.
    pub fn trains(&self) -> impl Iterator<Item = TrainId> {
        self.channels.iter().map(TrainChannel::train)
    }

    /// Hands on what has come, and looks from time to time who is there.
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
        let Wanted { trains, snapshot_interval } = &self.wanted;
        let channel = TrainChannel::open(&trains.host, train, *snapshot_interval, self.name)?;
        self.channels.push(channel);
        sink.opened(train)
    }
}
