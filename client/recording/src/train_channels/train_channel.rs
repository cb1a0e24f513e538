//! The channels of one train.

use std::time::Duration;

use dynocar::operator::suspicion::Suspicion;
use dynocar::output::report_line;
use dynocar_client::channel::{Receiver, Transport};
use dynocar_client::{ChannelError, Host, Peer, Role, SnapshotReader, monotonic_now_ns};
use dynocar_shared::services::{PIPELINES_MAX, SAMPLE_BUFFER};
use dynocar_shared::{ParameterSnapshot, PipelineKind, Reason, Status, TrainId, TrainSample};

use super::sink::{Sink, event};
use crate::event::{Event, EventKind};

/// The most samples taken in a row, before the other trains have their turn.
const TURN: usize = 4 * SAMPLE_BUFFER;

/// What was last seen of a pipeline.
#[derive(Clone, Copy, Debug, Default)]
struct LastSnapshot {
    epoch: u64,
    sequence: u64,
    status: (u32, u32),
    /// The number of the effect that is suspected.
    suspect: u32,
    /// The model's hash.
    model: u64,
    taken_ns: i64,
    is_silent: bool,
}

/// One train: its channels, and what was seen of it.
pub struct TrainChannel {
    train: TrainId,
    samples: Receiver<TrainSample>,
    snapshots: SnapshotReader,
    /// Least time between two snapshots of a pipeline, in ns.
    interval_ns: i64,
    /// The newest sample's number.
    newest: Option<u64>,
    pipelines: [Option<LastSnapshot>; PIPELINES_MAX],
    daemon: Option<u32>,
    controller: Option<u32>,
    /// True when samples have come since it was last looked who is there.
    is_driven: bool,
    /// Samples passed over since that was last reported.
    lost: u64,
    /// After the port: the last user goes only when its ports are gone.
    _transport: Transport,
}

impl TrainChannel {
    /// Opens the channels of a train; `name` is what their place is called.
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
        let snapshots = SnapshotReader::open(host, train)?;
        let transport = Transport::open(host, name)?;
        let samples = transport.receiver::<TrainSample>(train)?;
        transport.reserve()?;
        Ok(TrainChannel {
            train,
            samples,
            snapshots,
            interval_ns: interval.as_nanos() as i64,
            newest: None,
            pipelines: [None; PIPELINES_MAX],
            daemon: None,
            controller: None,
            is_driven: false,
            lost: 0,
            _transport: transport,
        })
    }

    /// The train.
    pub fn train(&self) -> TrainId {
        self.train
    }

    /// Hands on what has come.
    ///
    /// # Errors
    ///
    /// When it is not taken.
    pub fn take<S: Sink>(&mut self, sink: &mut S) -> Result<(), S::Error> {
        for _ in 0..TURN {
            let Some(sample) = self.samples.receive() else { break };
            self.count(sample.sequence, sink)?;
            sink.sample(&sample)?;
            self.is_driven = true;
        }
        self.snapshots.poll();
        let now_ns = monotonic_now_ns();
        for reading in self.snapshots.readings(now_ns) {
            let it = reading.snapshot;
            let seen = &mut self.pipelines[it.pipeline_index as usize];
            let known = seen.unwrap_or_default();
            let is_news = (it.epoch, it.sequence) != (known.epoch, known.sequence);
            let status = (it.status, it.reason);
            let is_other_status =
                seen.is_none() || status != known.status || it.epoch != known.epoch;
            let is_other_suspect = it.suspected_effect != known.suspect;
            let is_other_model = seen.is_some() && it.model_hash != known.model;
            let is_change = is_other_status || is_other_suspect || is_other_model;
            if seen.is_some()
                && !is_change
                && (!is_news || now_ns - known.taken_ns < self.interval_ns)
            {
                continue;
            }
            sink.snapshot(it)?;
            if is_other_status {
                sink.event(&status_event(self.train, it))?;
            }
            if is_other_suspect {
                sink.event(&suspicion_event(self.train, it))?;
            }
            if is_other_model {
                sink.event(&model_event(self.train, it))?;
            }
            *seen = Some(LastSnapshot {
                epoch: it.epoch,
                sequence: it.sequence,
                status,
                suspect: it.suspected_effect,
                model: it.model_hash,
                taken_ns: now_ns,
                is_silent: false,
            });
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
            let lost = event(self.train, EventKind::SamplesLost, text);
            sink.event(&Event { count: Some(missing), ..lost })?;
        }
        Ok(())
    }

    /// Looks who is there, and reports what has changed; what one left who is gone comes before that.
    ///
    /// # Errors
    ///
    /// When it is not taken.
    pub fn look<S: Sink>(&mut self, host: &Host, sink: &mut S) -> Result<(), S::Error> {
        if self.lost > 0 {
            report_line(&format!(
                "train {}: {} samples lost",
                self.train,
                std::mem::take(&mut self.lost)
            ));
        }
        let train = self.train;
        let was_driven = std::mem::take(&mut self.is_driven);
        let daemon = self.peer(host, Role::Daemon)?;
        let controller = self.peer(host, Role::Controller)?;
        self.take(sink)?;
        if daemon.as_ref().map(|it| it.0) != self.daemon {
            let (kind, text) = match &daemon {
                Some((process, words)) => {
                    sink.daemon_came(train, *process)?;
                    (EventKind::DaemonCame, words.clone())
                }
                None => (EventKind::DaemonGone, "no daemon".into()),
            };
            sink.event(&event(train, kind, text))?;
            self.daemon = daemon.map(|it| it.0);
        }
        // One that came and went between two looks is gone too.
        let was_missed = was_driven && controller.is_none() && self.controller.is_none();
        if was_missed || controller.as_ref().map(|it| it.0) != self.controller {
            self.is_driven &= controller.is_some();
            let (kind, text) = match &controller {
                Some((_, words)) => (EventKind::ControllerCame, words.clone()),
                None => (EventKind::ControllerGone, "no controller".into()),
            };
            sink.event(&event(train, kind, text))?;
            self.controller = controller.map(|it| it.0);
        }
        self.note_silence(sink)
    }

    fn peer(&self, host: &Host, role: Role) -> Result<Option<(u32, String)>, ChannelError> {
        Ok(match Peer::look_up(host, self.train, role)? {
            Peer::Absent => None,
            Peer::Compatible(it) => Some((it.process_id, it.to_string())),
            Peer::Incompatible(it) => Some((it.process_id, format!("incompatible: {it}"))),
        })
    }

    fn note_silence<S: Sink>(&mut self, sink: &mut S) -> Result<(), S::Error> {
        for reading in self.snapshots.readings(monotonic_now_ns()) {
            let Some(seen) = &mut self.pipelines[reading.snapshot.pipeline_index as usize] else {
                continue;
            };
            if reading.is_stale && !seen.is_silent {
                let text = format!("silent for {} ms", reading.age_ns / 1_000_000);
                let silent = event(self.train, EventKind::DaemonSilent, text);
                let pipeline_index = Some(reading.snapshot.pipeline_index);
                sink.event(&Event { pipeline_index, ..silent })?;
            }
            seen.is_silent = reading.is_stale;
        }
        Ok(())
    }
}

fn status_event(train: TrainId, it: &ParameterSnapshot) -> Event {
    let kind = it.pipeline_kind().map_or("unknown", PipelineKind::name);
    let reason = it.reason().map_or("unknown", Reason::name);
    let status = Status::name(it.status());
    let text = format!("{kind}: {status} ({reason}) at sample {}", it.sample_sequence);
    Event {
        pipeline_index: Some(it.pipeline_index),
        status: Some(it.status as i32),
        reason: Some(it.reason as i32),
        ..event(train, EventKind::StatusChanged, text)
    }
}

fn model_event(train: TrainId, it: &ParameterSnapshot) -> Event {
    let kind = it.pipeline_kind().map_or("unknown", PipelineKind::name);
    let text = format!("{kind}: model {:016x} is in force", it.model_hash);
    let pipeline_index = Some(it.pipeline_index);
    Event { pipeline_index, ..event(train, EventKind::ModelChanged, text) }
}

fn suspicion_event(train: TrainId, it: &ParameterSnapshot) -> Event {
    let (kind, text) = match Suspicion::of(it) {
        None => (EventKind::SuspicionEnded, "nothing is suspected".to_owned()),
        Some(suspicion) => (EventKind::SuspicionRaised, suspicion.to_string()),
    };
    let pipeline_index = Some(it.pipeline_index);
    Event { pipeline_index, ..event(train, kind, text) }
}
