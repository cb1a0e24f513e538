//! Observation of trains, in one vocabulary for all observers: arrivals and departures, and changes in the answers
//! of the pipelines. An observer is one reader of each train's snapshots, as every client is.

use dynocar_client::{Reading, SnapshotReader};
use dynocar_shared::services::PIPELINES_MAX;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{ParameterSnapshot, Reason, TrainId, vocabulary};
use dynocar_transport::{Announcement, ChannelError, Host, Peer, Role, monotonic_now_ns};

use crate::operator::{Suspicion, pipeline_name};

/// Selection of trains and pipelines to observe.
#[derive(Clone, Debug)]
pub struct ObservedSelection {
    /// The run-time directory.
    pub host: Host,
    /// The trains; every train that is there or comes, when empty.
    pub trains: Vec<TrainId>,
}

impl ObservedSelection {
    /// Returns the trains, in addition to the known ones, for which somebody now holds one of these roles; none where
    /// the selection names trains.
    ///
    /// # Errors
    ///
    /// When the run-time directory cannot be read.
    pub fn newcomers(
        &self,
        roles: &[Role],
        is_known: impl Fn(TrainId) -> bool,
    ) -> Result<Vec<TrainId>, ChannelError> {
        let mut newcomers = Vec::new();
        if self.trains.is_empty() {
            for &role in roles {
                newcomers.extend(Peer::trains(&self.host, role)?);
            }
        }
        newcomers.retain(|&train| !is_known(train));
        newcomers.sort_unstable();
        newcomers.dedup();
        Ok(newcomers)
    }
}

/// Returns the time in s since the newest sample behind a snapshot was published; `None` before the first.
pub fn sample_age_s(snapshot: &ParameterSnapshot, now_ns: i64) -> Option<f64> {
    let age_ns = now_ns.saturating_sub(snapshot.sample_published_ns).max(0);
    (snapshot.sample_sequence > 0).then_some(age_ns as f64 * 1e-9)
}

/// Latest observed state of a pipeline.
#[derive(Clone, Copy, Debug, Default)]
struct SeenPipeline {
    epoch: u64,
    status: (u32, u32),
    /// The number of the effect that is suspected.
    suspect: u32,
    /// The model's hash.
    model: u64,
    is_silent: bool,
}

/// A train that is observed.
#[derive(Debug)]
pub struct ObservedTrain {
    /// The train.
    pub id: TrainId,
    reader: Option<SnapshotReader>,
    daemon: Option<Announcement>,
    controller: Option<Announcement>,
    pipelines: [Option<SeenPipeline>; PIPELINES_MAX],
}

impl ObservedTrain {
    /// Returns a train whose snapshots are read as soon as a daemon serves it.
    pub fn new(id: TrainId) -> Self {
        let pipelines = [None; PIPELINES_MAX];
        ObservedTrain { id, reader: None, daemon: None, controller: None, pipelines }
    }

    /// Returns a train whose snapshots are read from now on.
    ///
    /// # Errors
    ///
    /// When the channel cannot be opened.
    pub fn open(host: &Host, id: TrainId) -> Result<Self, ChannelError> {
        let reader = Some(SnapshotReader::open(host, id)?);
        Ok(ObservedTrain { reader, ..ObservedTrain::new(id) })
    }

    /// Returns who served the train at the last look.
    pub fn daemon(&self) -> Option<&Announcement> {
        self.daemon.as_ref()
    }

    /// Returns who drove it.
    pub fn controller(&self) -> Option<&Announcement> {
        self.controller.as_ref()
    }

    /// Looks who serves and who drives the train, and opens the reader when it can be opened. Opens files: once in
    /// a while is enough.
    ///
    /// # Errors
    ///
    /// When an announcement cannot be read, the daemon is incompatible or its channel cannot be opened; the
    /// changes seen before are noted all the same.
    pub fn look(
        &mut self,
        host: &Host,
        changes: &mut Vec<TrainChange>,
    ) -> Result<(), ChannelError> {
        let daemon = Peer::look_up(host, self.id, Role::Daemon)?;
        note_peer(&daemon, &mut self.daemon, Role::Daemon, changes);
        // A fault of one of the two keeps nobody from seeing the other.
        let opened = self.open_reader(host, daemon);
        let controller = Peer::look_up(host, self.id, Role::Controller)?;
        note_peer(&controller, &mut self.controller, Role::Controller, changes);
        opened
    }

    /// Opens the reader of a daemon that fits, drops that of one that does not.
    fn open_reader(&mut self, host: &Host, daemon: Peer) -> Result<(), ChannelError> {
        match daemon {
            Peer::Incompatible(_) => {
                // Its place in the channel is of no use; a daemon that fits gets a new reader.
                self.reader = None;
                daemon.require_compatible(self.id, Role::Controller)?;
            }
            Peer::Compatible(_) if self.reader.is_none() => {
                self.reader = Some(SnapshotReader::open(host, self.id)?);
            }
            _ => {}
        }
        Ok(())
    }

    /// Returns the newest snapshot of every pipeline at a moment of the host's monotonic clock.
    pub fn readings(&self, now_ns: i64) -> impl Iterator<Item = Reading<'_>> {
        self.reader.iter().flat_map(move |reader| reader.readings(now_ns))
    }

    /// Takes the new snapshots; returns the changes of the pipelines.
    pub fn poll(&mut self) -> Vec<TrainChange> {
        let mut changes = Vec::new();
        let Some(reader) = &mut self.reader else { return changes };
        reader.poll();
        for reading in reader.readings(monotonic_now_ns()) {
            let seen = &mut self.pipelines[reading.snapshot.pipeline_index as usize];
            note_pipeline(&reading, seen, &mut changes);
        }
        changes
    }
}

fn note_peer(
    peer: &Peer,
    known: &mut Option<Announcement>,
    role: Role,
    changes: &mut Vec<TrainChange>,
) {
    let (now, text) = match peer {
        Peer::Absent => (None, format!("no {role}")),
        Peer::Compatible(it) => (Some(it.clone()), it.to_string()),
        Peer::Incompatible(it) => (Some(it.clone()), format!("incompatible: {it}")),
    };
    let process = |it: &Option<Announcement>| it.as_ref().map(|it| it.process_id);
    if process(&now) != process(known) {
        let kind = match (role, &now) {
            (Role::Daemon, Some(_)) => EventKind::DaemonCame,
            (Role::Daemon, None) => EventKind::DaemonGone,
            (Role::Controller, Some(_)) => EventKind::ControllerCame,
            (Role::Controller, None) => EventKind::ControllerGone,
        };
        changes.push(TrainChange::new(kind, text));
        *known = now;
    }
}

fn note_pipeline(
    reading: &Reading<'_>,
    seen: &mut Option<SeenPipeline>,
    changes: &mut Vec<TrainChange>,
) {
    let it = reading.snapshot;
    let name = || pipeline_name(it.pipeline_index, it.pipeline_kind());
    let of_pipeline = |kind, text| TrainChange {
        pipeline: Some(it.pipeline_index),
        ..TrainChange::new(kind, text)
    };
    let now = SeenPipeline {
        epoch: it.epoch,
        status: (it.status, it.reason),
        suspect: it.suspected_effect,
        model: it.model_hash,
        is_silent: reading.is_stale,
    };
    let known = seen.replace(now);
    if known.is_none_or(|known| (known.status, known.epoch) != (now.status, now.epoch)) {
        let (status, reason) = (it.status(), it.reason().map_or("unknown", Reason::name));
        let text = format!("{}: {status} ({reason}) at sample {}", name(), it.sample_sequence);
        let change = of_pipeline(EventKind::StatusChanged, text);
        changes.push(TrainChange { status: Some(now.status), ..change });
    }
    if known.unwrap_or_default().suspect != now.suspect {
        let (kind, text) = match Suspicion::from_snapshot(it) {
            None => (EventKind::SuspicionEnded, "nothing is suspected".to_owned()),
            Some(suspicion) => (EventKind::SuspicionRaised, suspicion.to_string()),
        };
        let effect = EffectKind::from_number(now.suspect);
        changes.push(TrainChange { effect, ..of_pipeline(kind, text) });
    }
    if known.is_some_and(|known| known.model != now.model) {
        let text = format!("{}: model {:016x} is in force", name(), now.model);
        changes.push(of_pipeline(EventKind::ModelChanged, text));
    }
    if now.is_silent && known.is_none_or(|known| !known.is_silent) {
        let text = format!("{}: silent for {} ms", name(), reading.age_ns / 1_000_000);
        changes.push(of_pipeline(EventKind::DaemonSilent, text));
    }
}

vocabulary! {
    /// The kind of an event.
    EventKind: u32 {
        /// None that this release knows.
        Unknown = 0 "unknown",
        /// The recorder has opened the train's channels.
        RecordingBegan = 1 "recording_began",
        /// The recorder was asked to end.
        RecordingEnded = 2 "recording_ended",
        /// A daemon serves the train.
        DaemonCame = 3 "daemon_came",
        /// No daemon serves the train any more.
        DaemonGone = 4 "daemon_gone",
        /// A controller drives the train.
        ControllerCame = 5 "controller_came",
        /// No controller drives the train any more.
        ControllerGone = 6 "controller_gone",
        /// A pipeline's status or its reason is another than before.
        StatusChanged = 7 "status_changed",
        /// Sequence numbers were passed over: samples that the recording lacks.
        SamplesLost = 8 "samples_lost",
        /// The daemon has vouched for no snapshot of a pipeline for a while.
        DaemonSilent = 9 "daemon_silent",
        /// The residual's pipeline suspects an effect that it did not suspect before.
        SuspicionRaised = 10 "suspicion_raised",
        /// It suspects none any more.
        SuspicionEnded = 11 "suspicion_ended",
        /// A person or a program asked to keep this moment for good.
        KeepRequested = 12 "keep_requested",
        /// A pipeline uses another model of train and line than before.
        ModelChanged = 13 "model_changed",
        /// A learner wrote down a maintenance event: a dragging brake, low adhesion, another load.
        MaintenanceFound = 14 "maintenance_found",
    }
}

/// Change of a train.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrainChange {
    /// Kind of the event.
    pub kind: EventKind,
    /// The pipeline's number in the daemon's configuration, where it concerns one.
    pub pipeline: Option<u32>,
    /// Numbers of the new status and its reason, where that has changed.
    pub status: Option<(u32, u32)>,
    /// The effect that is suspected now, where that has changed.
    pub effect: Option<EffectKind>,
    /// The same in words.
    pub text: String,
}

impl TrainChange {
    /// Returns a change without numbers.
    pub fn new(kind: EventKind, text: String) -> Self {
        TrainChange { kind, pipeline: None, status: None, effect: None, text }
    }
}
