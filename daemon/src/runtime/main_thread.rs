//! Work of the main thread while the pipeline threads run.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dynocar_core::plausibility::{DetectedFault, InputFault};
use dynocar_core::remedy::{of_reason, of_refusal};
use dynocar_shared::snapshot::REJECTION_REASONS;
use dynocar_shared::vocabulary::{EffectKind, KindRow};
use dynocar_shared::{ParameterSnapshot, Reason, RejectionReason, Status, TrainId};
use dynocar_transport::channel::SampleCount;
use dynocar_transport::{Announcement, ChannelError, Host, Peer, Role, monotonic_now_ns};
use tracing::{info, warn};

use super::worker::PipelineReport;
use crate::log::{RefusalLog, StatusAndReason, StatusLog};
use crate::observing::ObservedTrain;
use crate::operator::{Suspicion, refusals, refused_words};
use crate::supervision::health::Verdict;

/// Time between two rounds of the main thread.
const ROUND: Duration = Duration::from_millis(100);
/// Rounds between two checks of who drives the trains.
const ROUNDS_PER_PEER_CHECK: u32 = 4;

/// A pipeline with its name in the log.
pub struct WatchedPipeline {
    /// The pipeline's name.
    pub name: String,
    /// The train.
    pub train: TrainId,
    /// Number in the configuration.
    pub index: u32,
    /// Counts and details from its thread.
    pub report: PipelineReport,
}

/// State of the log of one pipeline.
struct PipelineLog {
    pipeline: WatchedPipeline,
    statuses: StatusLog,
    suspects: StatusLog,
    /// Input fault of the last look.
    implausible: Option<DetectedFault>,
    unsent: u64,
    lost: u64,
}

/// StatusAndReason of the log of one train.
struct TrainLog {
    id: TrainId,
    count: Arc<SampleCount>,
    /// Its snapshots, as soon as there is a place to read them.
    observed: Option<ObservedTrain>,
    refusals: RefusalLog,
    /// The controller of the last look, after the first.
    controller: Option<Option<Announcement>>,
}

/// Watches signals, peers, snapshots, tallies and details, and logs the changes.
pub struct RuntimeWatch {
    host: Host,
    /// Start of the daemon, by which its snapshots differ from those of one before it.
    epoch: u64,
    trains: Vec<TrainLog>,
    pipelines: Vec<PipelineLog>,
    /// Why nobody could be looked up, the last time; said once.
    failure: Option<String>,
}

impl RuntimeWatch {
    /// Returns a watch over the daemon's trains and pipelines.
    pub fn new(
        host: Host,
        epoch: u64,
        trains: Vec<(TrainId, Arc<SampleCount>)>,
        pipelines: Vec<WatchedPipeline>,
    ) -> Self {
        let (now, refusals) = (Instant::now(), RefusalLog::default());
        let trains = trains.into_iter().map(|(id, count)| {
            let refusals = refusals.clone();
            TrainLog { id, count, observed: None, refusals, controller: None }
        });
        let pipelines = pipelines.into_iter().map(|pipeline| {
            let (statuses, suspects) = (StatusLog::new(now), StatusLog::new(now));
            PipelineLog { pipeline, statuses, suspects, implausible: None, unsent: 0, lost: 0 }
        });
        let (trains, pipelines) = (trains.collect(), pipelines.collect());
        RuntimeWatch { host, epoch, trains, pipelines, failure: None }
    }

    /// Watches until a signal asks the daemon to stop, or a pipeline thread has ended.
    pub fn until_stopped(&mut self, stop: &AtomicBool, mut has_ended: impl FnMut() -> bool) {
        let mut round = 0;
        while !stop.load(Ordering::Relaxed) && !has_ended() {
            if round % ROUNDS_PER_PEER_CHECK == 0 {
                self.check_peers();
            }
            self.report_changes();
            round += 1;
            std::thread::sleep(ROUND);
        }
    }

    /// Logs the final counts.
    pub fn report_totals(&mut self) {
        self.poll();
        for log in &self.pipelines {
            let PipelineLog { pipeline, statuses, .. } = log;
            let train = self.trains.iter().find(|it| it.id == pipeline.train);
            let snapshot = train.and_then(|it| it.snapshot(pipeline.index, self.epoch));
            let snapshot = snapshot.unwrap_or_else(ParameterSnapshot::empty);
            info!(
                pipeline = pipeline.name,
                train = pipeline.train.0,
                used = snapshot.samples_used,
                rejected = snapshot.samples_rejected,
                lost = snapshot.samples_lost,
                refused = refused_words(&refusals(&snapshot.rejected_by_reason)),
                status_changes = statuses.changes(),
                "stopped"
            );
        }
    }

    fn check_peers(&mut self) {
        for train in &mut self.trains {
            let Err(error) = train.look(&self.host) else { continue };
            let error = error.to_string();
            if self.failure.as_ref() != Some(&error) {
                warn!(train = train.id.0, "{error}");
                self.failure = Some(error);
            }
        }
    }

    /// Takes the newest snapshots.
    fn poll(&mut self) {
        for observed in self.trains.iter_mut().filter_map(|train| train.observed.as_mut()) {
            observed.poll();
        }
    }

    fn report_changes(&mut self) {
        self.poll();
        // Once for all pipelines of a train.
        let known = |log: &PipelineLog| Some((log.pipeline.train, log.implausible?.fault));
        let mut reported: Vec<(TrainId, InputFault)> =
            self.pipelines.iter().filter_map(known).collect();
        let now = Instant::now();
        for train in &mut self.trains {
            let mut refused = [0; REJECTION_REASONS];
            for log in self.pipelines.iter_mut().filter(|it| it.pipeline.train == train.id) {
                log.report_beyond_snapshots(&mut reported);
                let snapshot = train.snapshot(log.pipeline.index, self.epoch);
                let Some(snapshot) = snapshot else { continue };
                log.report(&snapshot, now);
                let counts = refused.iter_mut().zip(snapshot.rejected_by_reason);
                counts.for_each(|(most, it)| *most = it.max(*most));
            }
            let new = train.refusals.look(&refused, now);
            report_refusals(train.id, &new);
        }
    }
}

impl TrainLog {
    /// Looks who drives the train, logs a change, and opens the snapshots unless they are read already.
    fn look(&mut self, host: &Host) -> Result<(), ChannelError> {
        // Before the look: all that had begun by then has ended when no controller is there.
        let begun = self.count.begun();
        let seen = match Peer::look_up(host, self.id, Role::Controller)? {
            Peer::Absent => {
                self.count.end(begun);
                None
            }
            Peer::Compatible(peer) | Peer::Incompatible(peer) => Some(peer),
        };
        if self.controller.as_ref() != Some(&seen) {
            report_controller(self.id, seen.as_ref());
            self.controller = Some(seen);
        }
        if self.observed.is_none() {
            self.observed = Some(ObservedTrain::open(host, self.id)?);
        }
        Ok(())
    }

    /// Returns the newest snapshot of a pipeline by a daemon.
    fn snapshot(&self, index: u32, epoch: u64) -> Option<ParameterSnapshot> {
        let mut snapshots =
            self.observed.as_ref()?.readings(monotonic_now_ns()).map(|it| it.snapshot);
        snapshots.find(|it| (it.pipeline_index, it.epoch) == (index, epoch)).copied()
    }
}

impl PipelineLog {
    /// Logs news that no snapshot carries.
    fn report_beyond_snapshots(&mut self, reported: &mut Vec<(TrainId, InputFault)>) {
        let PipelineReport { tally, details } = &self.pipeline.report;
        let (implausible, unsent) = (details.implausible(), tally.unsent());
        let (name, train) = (self.pipeline.name.as_str(), self.pipeline.train);
        if let Some(detected) = implausible
            && !reported.contains(&(train, detected.fault))
        {
            reported.push((train, detected.fault));
            let (train, code) = (train.0, detected.fault.name());
            warn!(train, code, "the samples cannot be true: {detected}");
        }
        if unsent > self.unsent {
            let (train, unsent) = (train.0, unsent - self.unsent);
            warn!(pipeline = name, train, unsent, "snapshots the transport did not take");
        }
        (self.implausible, self.unsent) = (implausible, unsent);
    }

    /// Logs news of a pipeline's status, its lost samples and its suspicion.
    fn report(&mut self, snapshot: &ParameterSnapshot, now: Instant) {
        let (pipeline, train) = (self.pipeline.name.as_str(), self.pipeline.train.0);
        if let Some(untold) = self.statuses.look((snapshot.status, snapshot.reason), now) {
            self.report_status(snapshot, &untold);
        }
        if snapshot.samples_lost > self.lost {
            let lost = snapshot.samples_lost - self.lost;
            warn!(pipeline, train, lost, "samples lost");
        }
        self.lost = snapshot.samples_lost;
        let suspicion = Suspicion::from_snapshot(snapshot);
        let suspect = suspicion.map_or(0, |it| it.effect.map_or(u32::MAX, |it| it as u32));
        // Nothing suspected is no news before something is.
        if self.suspects.look((suspect, 0), now).is_none()
            || (suspect == 0 && self.suspects.changes() == 0)
        {
            return;
        }
        let Some(suspicion) = suspicion else {
            info!(pipeline, train, "nothing is suspected any more");
            return;
        };
        let (suspect, force) = (suspicion.name(), suspicion.force());
        let position_m = self.pipeline.report.details.position_m();
        let near_km = position_m.is_finite().then_some(1e-3 * position_m);
        let near_km = near_km.map(|it| format!("{it:.3}"));
        let remedy = KindRow::of(suspicion.effect.unwrap_or(EffectKind::Unknown)).to_do;
        warn!(
            pipeline,
            train, suspect, force, near_km, "the model lacks a force: {suspicion}; to do: {remedy}"
        );
    }

    /// A status that wants a person is a warning, with the recommended action; any other is information.
    fn report_status(&self, snapshot: &ParameterSnapshot, untold: &[(StatusAndReason, u64)]) {
        let (pipeline, train) = (self.pipeline.name.as_str(), self.pipeline.train.0);
        let words = |(status, reason): StatusAndReason| {
            let status = Status::from_number(status).unwrap_or(Status::Invalid);
            (status, Reason::from_number(reason).unwrap_or(Reason::None))
        };
        let (status, reason) = words((snapshot.status, snapshot.reason));
        // Changes to and fro that no line of their own reports.
        let untold: Vec<String> = untold
            .iter()
            .map(|&(state, count)| (words(state), count))
            .map(|((status, reason), count)| format!("{status} ({reason}) {count}"))
            .collect();
        let untold = (!untold.is_empty()).then(|| untold.join(", "));
        if Verdict::new(status, Some(reason)) == Verdict::Ok {
            info!(pipeline, train, %status, %reason, untold, "status");
            return;
        }
        let refused = refused_words(&refusals(&snapshot.rejected_by_reason));
        let refused = (reason == Reason::BadInput && !refused.is_empty()).then_some(refused);
        let (meaning, remedy) = (reason.meaning().trim().trim_end_matches('.'), of_reason(reason));
        warn!(pipeline, train, %status, %reason, untold, refused, "not to be relied on: {meaning}; to do: {remedy}");
    }
}

/// Samples of a train that were refused since the last such line.
fn report_refusals(train: TrainId, new: &[(RejectionReason, u32)]) {
    let Some(remedy) = new.first().and_then(|it| of_refusal(it.0)) else { return };
    let refused = refused_words(new);
    warn!(train = train.0, refused, "samples refused; to do: {remedy}");
}

fn report_controller(train: TrainId, controller: Option<&Announcement>) {
    let ours = Announcement::of_this_process(Role::Daemon);
    match controller {
        None => info!(train = train.0, "no controller"),
        Some(theirs) if theirs.is_compatible_with(&ours) => {
            info!(train = train.0, process = theirs.process_id, "controller connected");
        }
        Some(theirs) => {
            let error = ChannelError::of_peer(train, theirs.clone(), Role::Daemon);
            warn!(train = train.0, "{error}");
        }
    }
}
