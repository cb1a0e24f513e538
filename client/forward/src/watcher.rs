//! Trains that are observed, and what is made of it for the broker.
//!
//! It never waits for the broker: it takes what the channels hold, and what it makes of that goes into the queue.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dynocar::observing::{Change, ObservedTrain, Wanted};
use dynocar::output::report_line;
use dynocar_client::{Role, monotonic_now_ns};
use dynocar_shared::TrainId;

use crate::node::{Known, locked};
use crate::payload::utc_ms;
use crate::train::Train;

/// How often the channels are looked at: how late an event is seen at most.
const POLL: Duration = Duration::from_millis(50);
/// How often it is looked who is there.
const LOOK: Duration = Duration::from_secs(1);

/// After so long without a word a pipeline counts as silent: a controller cannot wait so long, a host far away need
/// not be shown every hesitation.
const SILENT_AFTER: Duration = Duration::from_secs(3);

/// One train.
struct TrainChannel {
    observed: ObservedTrain,
    due: Instant,
    /// Why it cannot be read, as it was last reported.
    trouble: String,
}

impl TrainChannel {
    fn new(train: TrainId) -> Self {
        let observed = ObservedTrain::new(train, Some(SILENT_AFTER.as_nanos() as i64));
        TrainChannel { observed, due: Instant::now(), trouble: String::new() }
    }
}

/// Watches trains until asked to end, and publishes what they do: changes of numbers every so often, events at once.
pub fn watch(wanted: &Wanted, every: Duration, known: &Mutex<Known>, must_end: &AtomicBool) {
    let mut channels: Vec<TrainChannel> =
        wanted.trains.iter().map(|&train| TrainChannel::new(train)).collect();
    let mut looked: Option<Instant> = None;
    while !must_end.load(Ordering::Relaxed) {
        let begun = Instant::now();
        let is_look = looked.is_none_or(|it| it.elapsed() >= LOOK);
        if is_look {
            looked = Some(begun);
            // A directory that cannot be read now may be read in a second.
            let is_known = |train| channels.iter().any(|channel| channel.observed.id == train);
            let newcomers = wanted.newcomers(&[Role::Daemon], is_known).unwrap_or_default();
            channels.extend(newcomers.into_iter().map(TrainChannel::new));
        }
        for channel in &mut channels {
            let mut changes = Vec::new();
            if is_look {
                channel.look(wanted, &mut changes);
            }
            changes.extend(channel.observed.poll());
            channel.publish(changes, every, known);
        }
        std::thread::sleep(POLL.saturating_sub(begun.elapsed()).max(POLL / 10));
    }
}

impl TrainChannel {
    /// Looks who is there; what hinders that is reported once.
    fn look(&mut self, wanted: &Wanted, changes: &mut Vec<Change>) {
        let looked = self.observed.look(&wanted.host, changes);
        let trouble = looked.err().map_or(String::new(), |error| error.to_string());
        if !trouble.is_empty() && self.trouble != trouble {
            report_line(&format!("dynocar forward: {trouble}"));
        }
        self.trouble = trouble;
    }

    /// Publishes what the snapshots say, when that is due or something has happened.
    fn publish(&mut self, changes: Vec<Change>, every: Duration, known: &Mutex<Known>) {
        let is_due = Instant::now() >= self.due;
        if changes.is_empty() && (!is_due || !self.observed.is_heard()) {
            return;
        }
        if is_due {
            self.due = Instant::now() + every;
        }
        let (now_ns, now_ms, id) = (monotonic_now_ns(), utc_ms(), self.observed.id);
        let mut known = locked(known);
        let number = known.trains.len() as u64 + 1;
        let train = known.trains.entry(id).or_insert_with(|| Train::new(id, number));
        train.take(self.observed.readings(now_ns), now_ns, now_ms);
        let made = match changes.is_empty() {
            true => vec![train.publication(now_ms)],
            false => {
                let event = |it: Change| train.event(it.kind.name(), it.text, now_ms);
                changes.into_iter().map(event).collect()
            }
        };
        made.into_iter().for_each(|it| known.publish(it));
    }
}
