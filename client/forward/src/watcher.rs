//! Readers of snapshots, daemons that come and go, and what is made of it for the broker.
//!
//! It never waits for the broker: it takes what the channels hold, and what it makes of that goes into the queue.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dynocar::output::report_line;
use dynocar_client::{ChannelError, Host, Peer, Reading, Role, SnapshotReader, monotonic_now_ns};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{Reason, Status, TrainId};

use crate::fields::folder;
use crate::node::{Known, locked};
use crate::payload::utc_ms;
use crate::train::Train;

/// How often the channels are looked at: how late an event is seen at most.
const POLL: Duration = Duration::from_millis(50);
/// How often it is looked who is there.
const LOOK: Duration = Duration::from_secs(1);

/// After so long without a word a daemon counts as silent: a controller cannot wait so long, a host far away need
/// not be shown every hesitation.
const SILENT_AFTER: Duration = Duration::from_secs(3);

/// An event: its kind, and in words.
type Event = (&'static str, String);

/// What was last seen of a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct LastSnapshot {
    status: Status,
    reason: Option<Reason>,
    suspect: u32,
}

/// One train with the one reader of its snapshots.
struct TrainChannel {
    train: TrainId,
    reader: Option<SnapshotReader>,
    daemon: Option<u32>,
    controller: Option<u32>,
    pipelines: BTreeMap<u32, LastSnapshot>,
    is_silent: bool,
    due: Instant,
    /// Why it cannot be read, as it was last reported.
    trouble: String,
}

/// Watches trains and publishes what they do.
pub struct Watcher<'a> {
    host: Host,
    /// Empty for every train that is served.
    wanted: Vec<TrainId>,
    every: Duration,
    known: &'a Mutex<Known>,
    channels: Vec<TrainChannel>,
}

impl<'a> Watcher<'a> {
    /// A watcher of these trains; of all that are served, when none is named.
    pub fn new(host: Host, wanted: Vec<TrainId>, every: Duration, known: &'a Mutex<Known>) -> Self {
        let mut watcher = Watcher { host, wanted, every, known, channels: Vec::new() };
        watcher.wanted.clone().into_iter().for_each(|train| watcher.add(train));
        watcher
    }

    /// Watches until asked to end.
    pub fn run(&mut self, must_end: &AtomicBool) {
        let mut looked: Option<Instant> = None;
        while !must_end.load(Ordering::Relaxed) {
            let begun = Instant::now();
            let is_look = looked.is_none_or(|it| it.elapsed() >= LOOK);
            if is_look {
                looked = Some(begun);
                self.find_trains();
            }
            for channel in &mut self.channels {
                let mut events = Vec::new();
                if is_look {
                    channel.look_up(&self.host, &mut events);
                }
                channel.poll(events, self.every, self.known);
            }
            std::thread::sleep(POLL.saturating_sub(begun.elapsed()).max(POLL / 10));
        }
    }

    fn find_trains(&mut self) {
        if !self.wanted.is_empty() {
            return;
        }
        // A directory that cannot be read now may be read in a second.
        for train in Peer::trains(&self.host, Role::Daemon).unwrap_or_default() {
            if self.channels.iter().all(|channel| channel.train != train) {
                self.add(train);
            }
        }
    }

    fn add(&mut self, train: TrainId) {
        self.channels.push(TrainChannel {
            train,
            reader: None,
            daemon: None,
            controller: None,
            pipelines: BTreeMap::new(),
            is_silent: false,
            due: Instant::now(),
            trouble: String::new(),
        });
    }
}

impl TrainChannel {
    /// Looks who is there, and opens the reader when it can be opened.
    fn look_up(&mut self, host: &Host, events: &mut Vec<Event>) {
        match self.peers(host, events) {
            Ok(()) => self.trouble.clear(),
            Err(error) => {
                let trouble = error.to_string();
                if self.trouble != trouble {
                    report_line(&format!("dynocar forward: {trouble}"));
                    self.trouble = trouble;
                }
            }
        }
    }

    fn peers(&mut self, host: &Host, events: &mut Vec<Event>) -> Result<(), ChannelError> {
        let mut changed = |peer: &Peer, last: &mut Option<u32>, came, gone| {
            let (process, text) = match peer {
                Peer::Absent => (None, String::new()),
                Peer::Compatible(it) | Peer::Incompatible(it) => {
                    (Some(it.process_id), it.to_string())
                }
            };
            if std::mem::replace(last, process) != process {
                events.push(if process.is_some() { (came, text) } else { (gone, text) });
            }
        };
        let controller = Peer::look_up(host, self.train, Role::Controller)?;
        changed(&controller, &mut self.controller, "controller_came", "controller_gone");
        let daemon = Peer::look_up(host, self.train, Role::Daemon)?;
        changed(&daemon, &mut self.daemon, "daemon_came", "daemon_gone");
        match daemon {
            Peer::Incompatible(_) => {
                // Its place in the channel is of no use; a daemon that fits gets a new reader.
                self.reader = None;
                daemon.require_compatible(self.train, Role::Controller)?;
            }
            Peer::Compatible(_) if self.reader.is_none() => {
                let mut reader = SnapshotReader::open(host, self.train)?;
                reader.set_stale_after_ns(SILENT_AFTER.as_nanos() as i64);
                self.reader = Some(reader);
            }
            _ => {}
        }
        Ok(())
    }

    /// Takes what has come, and publishes it when it is due or something has happened.
    fn poll(&mut self, mut events: Vec<Event>, every: Duration, known: &Mutex<Known>) {
        let now_ns = monotonic_now_ns();
        if let Some(reader) = &mut self.reader {
            reader.poll();
            let mut is_silent = true;
            for reading in reader.readings(now_ns) {
                is_silent &= reading.is_stale;
                note(&mut self.pipelines, &reading, &mut events);
            }
            if is_silent && !self.is_silent && !self.pipelines.is_empty() {
                events.push((
                    "daemon_silent",
                    format!("no word of the daemon for {} s", SILENT_AFTER.as_secs()),
                ));
            }
            self.is_silent = is_silent;
        }
        let is_due = Instant::now() >= self.due;
        if events.is_empty() && (!is_due || self.pipelines.is_empty()) {
            return;
        }
        if is_due {
            self.due = Instant::now() + every;
        }
        let now_ms = utc_ms();
        let mut known = locked(known);
        let number = known.trains.len() as u64 + 1;
        let train =
            known.trains.entry(self.train).or_insert_with(|| Train::new(self.train, number));
        if let Some(reader) = &self.reader {
            train.take(reader.readings(now_ns), now_ns, now_ms);
        }
        let mut made = Vec::new();
        let has_events = !events.is_empty();
        for (kind, text) in events {
            made.push(train.event(kind, text, now_ms));
        }
        if !has_events {
            made.push(train.publication(now_ms));
        }
        made.into_iter().for_each(|it| known.publish(it));
    }
}

/// Notes what has changed about a pipeline. Silence is an event of the train, not of each pipeline.
fn note(
    pipelines: &mut BTreeMap<u32, LastSnapshot>,
    reading: &Reading<'_>,
    events: &mut Vec<Event>,
) {
    if reading.is_stale {
        return;
    }
    let it = reading.snapshot;
    let now = LastSnapshot {
        status: reading.status(),
        reason: reading.reason(),
        suspect: it.suspected_effect,
    };
    let last = pipelines.insert(it.pipeline_index, now);
    let name = folder(it.pipeline_index, it.pipeline_kind());
    if last.is_none_or(|last| (last.status, last.reason) != (now.status, now.reason)) {
        let reason = now.reason.map_or("unknown", Reason::name);
        let (status, sample) = (now.status.name(), it.sample_sequence);
        let text = format!("{name}: {status} ({reason}) at sample {sample}");
        events.push(("status_changed", text));
    }
    if last.map_or(0, |last| last.suspect) != now.suspect {
        let suspect = EffectKind::from_number(now.suspect).map_or("unknown", EffectKind::name);
        let evidence = it.suspicion_evidence;
        events.push(("suspect_changed", format!("{name}: {suspect}, evidence {evidence:.0}")));
    }
}
