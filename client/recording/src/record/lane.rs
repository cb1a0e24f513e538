//! One train that is recorded.

use dynocar::output::tell;
use dynocar_client::channel::{Receiver, Transport};
use dynocar_client::{ChannelError, Peer, Role, SnapshotReader, monotonic_now_ns};
use dynocar_shared::services::{PIPELINES_MAX, SAMPLE_BUFFER};
use dynocar_shared::{ParameterSnapshot, PipelineKind, Reason, Status, TrainId, TrainSample};

use super::configuration::Configuration;
use super::{Files, RecordError, Settings, event};
use crate::event::{Event, EventKind};

/// The most samples taken in a row, before the other trains and the flush have their turn.
const TURN: usize = 4 * SAMPLE_BUFFER;

/// What was last seen of a pipeline.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    epoch: u64,
    sequence: u64,
    status: (u32, u32),
    written_ns: i64,
    is_silent: bool,
}

/// One train: its channels, and what was seen of it.
pub struct Lane {
    train: TrainId,
    samples: Receiver<TrainSample>,
    snapshots: SnapshotReader,
    /// Least time between two snapshots of a pipeline, in ns.
    interval_ns: i64,
    /// The newest sample's number.
    newest: Option<u64>,
    pipelines: [Option<Seen>; PIPELINES_MAX],
    daemon: Option<u32>,
    controller: Option<u32>,
    /// Samples passed over since that was last told.
    lost: u64,
    /// After the port: the last user goes only when its ports are gone.
    _transport: Transport,
}

impl Lane {
    /// Opens the channels of a train.
    ///
    /// # Errors
    ///
    /// When they cannot be opened or all their places are taken.
    pub fn open(
        settings: &Settings,
        train: TrainId,
        files: &mut Files,
    ) -> Result<Self, RecordError> {
        let snapshots = SnapshotReader::open(&settings.host, train)?;
        let transport = Transport::open(&settings.host, "dynocar-recorder")?;
        let samples = transport.receiver::<TrainSample>(train)?;
        transport.reserve()?;
        files.event(&event(train, EventKind::RecordingBegan, format!("train {train}")))?;
        Ok(Lane {
            train,
            samples,
            snapshots,
            interval_ns: settings.snapshot_interval.as_nanos() as i64,
            newest: None,
            pipelines: [None; PIPELINES_MAX],
            daemon: None,
            controller: None,
            lost: 0,
            _transport: transport,
        })
    }

    /// The train.
    pub fn train(&self) -> TrainId {
        self.train
    }

    /// Records what has come.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn take(&mut self, files: &mut Files) -> Result<(), RecordError> {
        for _ in 0..TURN {
            let Some(sample) = self.samples.receive() else { break };
            self.count(sample.sequence, files)?;
            files.sample(&sample)?;
        }
        self.snapshots.poll();
        let now_ns = monotonic_now_ns();
        for reading in self.snapshots.readings(now_ns) {
            let it = reading.snapshot;
            let seen = &mut self.pipelines[it.pipeline_index as usize];
            let known = seen.unwrap_or_default();
            let is_news = (it.epoch, it.sequence) != (known.epoch, known.sequence);
            let status = (it.status, it.reason);
            let is_change = seen.is_none() || status != known.status || it.epoch != known.epoch;
            if seen.is_some()
                && !is_change
                && (!is_news || now_ns - known.written_ns < self.interval_ns)
            {
                continue;
            }
            files.snapshot(it)?;
            if is_change {
                files.event(&status_event(self.train, it))?;
            }
            *seen = Some(Seen {
                epoch: it.epoch,
                sequence: it.sequence,
                status,
                written_ns: now_ns,
                is_silent: false,
            });
        }
        Ok(())
    }

    /// Counts the numbers that were passed over. A number that is not greater than the last is of a
    /// count that was begun anew.
    fn count(&mut self, sequence: u64, files: &mut Files) -> Result<(), RecordError> {
        let missing = match self.newest.replace(sequence) {
            Some(newest) if sequence > newest => sequence - newest - 1,
            _ => return Ok(()),
        };
        if missing > 0 {
            self.lost += missing;
            let text = format!("samples {} to {} never came", sequence - missing, sequence - 1);
            let lost = event(self.train, EventKind::SamplesLost, text);
            files.lost(&Event { count: Some(missing), ..lost }, missing)?;
        }
        Ok(())
    }

    /// Looks who is there, and tells what has changed.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn look(&mut self, settings: &Settings, files: &mut Files) -> Result<(), RecordError> {
        if self.lost > 0 {
            tell(&format!("train {}: {} samples lost", self.train, std::mem::take(&mut self.lost)));
        }
        let train = self.train;
        let daemon = self.peer(settings, Role::Daemon)?;
        if daemon.as_ref().map(|it| it.0) != self.daemon {
            let (kind, text) = match &daemon {
                Some((process, words)) => {
                    let found = Configuration::of(settings.configuration.as_deref(), *process);
                    match found {
                        Ok(configuration) => files.attach(configuration)?,
                        Err(problem) => tell(&format!("train {train}: {problem}")),
                    }
                    (EventKind::DaemonCame, words.clone())
                }
                None => (EventKind::DaemonGone, "no daemon".into()),
            };
            files.event(&event(train, kind, text))?;
            self.daemon = daemon.map(|it| it.0);
        }
        let controller = self.peer(settings, Role::Controller)?;
        if controller.as_ref().map(|it| it.0) != self.controller {
            let (kind, text) = match &controller {
                Some((_, words)) => (EventKind::ControllerCame, words.clone()),
                None => (EventKind::ControllerGone, "no controller".into()),
            };
            files.event(&event(train, kind, text))?;
            self.controller = controller.map(|it| it.0);
        }
        self.note_silence(files)
    }

    fn peer(&self, settings: &Settings, role: Role) -> Result<Option<(u32, String)>, ChannelError> {
        Ok(match Peer::look_up(&settings.host, self.train, role)? {
            Peer::Absent => None,
            Peer::Compatible(it) => Some((it.process_id, it.to_string())),
            Peer::Incompatible(it) => Some((it.process_id, format!("incompatible: {it}"))),
        })
    }

    fn note_silence(&mut self, files: &mut Files) -> Result<(), RecordError> {
        for reading in self.snapshots.readings(monotonic_now_ns()) {
            let Some(seen) = &mut self.pipelines[reading.snapshot.pipeline_index as usize] else {
                continue;
            };
            if reading.is_stale && !seen.is_silent {
                let text = format!("silent for {} ms", reading.age_ns / 1_000_000);
                let silent = event(self.train, EventKind::DaemonSilent, text);
                let pipeline_index = Some(reading.snapshot.pipeline_index);
                files.event(&Event { pipeline_index, ..silent })?;
            }
            seen.is_silent = reading.is_stale;
        }
        Ok(())
    }

    /// Notes that the recorder was asked to end.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn end(&mut self, files: &mut Files) -> Result<(), RecordError> {
        files.event(&event(self.train, EventKind::RecordingEnded, format!("train {}", self.train)))
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
