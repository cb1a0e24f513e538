//! Work of the main thread while the pipeline threads run.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dynocar_core::plausibility::InputFault;
use dynocar_core::remedy::{of_reason, of_refusal};
use dynocar_shared::snapshot::REJECTION_REASONS;
use dynocar_shared::vocabulary::{EffectKind, KindRow};
use dynocar_shared::{Reason, RejectionReason, Status, TrainId};
use dynocar_transport::channel::SampleCount;
use dynocar_transport::{Announcement, ChannelError, Host, Peer, Role};
use tracing::{info, warn};

use super::status_log::{RefusalLog, StatusAndReason, StatusLog};
use super::tally::{Tally, TallyReading};
use crate::operator::{refusals, refused_words};
use crate::supervision::health::Verdict;

/// How often the main thread looks around.
const ROUND: Duration = Duration::from_millis(100);
/// Rounds between two looks at who drives the trains.
const ROUNDS_PER_PEER_CHECK: u32 = 4;

/// A tally with the names it is logged under.
pub struct WatchedPipeline {
    /// The pipeline's name.
    pub name: String,
    /// The train.
    pub train: TrainId,
    /// Counters of its thread.
    pub tally: Arc<Tally>,
}

/// State of the log of one pipeline.
struct PipelineLog {
    statuses: StatusLog,
    suspects: StatusLog,
}

/// Watches signals, peers and tallies, and writes what changes into the log.
pub struct RuntimeWatch {
    host: Host,
    trains: Vec<(TrainId, Arc<SampleCount>)>,
    pipelines: Vec<WatchedPipeline>,
    readings: Vec<TallyReading>,
    logs: Vec<PipelineLog>,
    refusals: HashMap<TrainId, RefusalLog>,
    controllers: HashMap<TrainId, Option<Announcement>>,
    /// Why nobody could be looked up, the last time; said once.
    failure: Option<String>,
}

impl RuntimeWatch {
    /// A watch over the daemon's trains and pipelines.
    pub fn new(
        host: Host,
        trains: Vec<(TrainId, Arc<SampleCount>)>,
        pipelines: Vec<WatchedPipeline>,
    ) -> Self {
        let readings = vec![TallyReading::default(); pipelines.len()];
        let logs = pipelines.iter().map(|_| PipelineLog::new(Instant::now())).collect();
        let (refusals, controllers) = (HashMap::new(), HashMap::new());
        let failure = None;
        RuntimeWatch { host, trains, pipelines, readings, logs, refusals, controllers, failure }
    }

    /// Watches until a signal asks the daemon to stop, or a pipeline thread has ended.
    pub fn until_stopped(&mut self, stop: &AtomicBool, mut has_ended: impl FnMut() -> bool) {
        let mut round = 0;
        while !stop.load(Ordering::Relaxed) && !has_ended() {
            if round % ROUNDS_PER_PEER_CHECK == 0 {
                self.check_controllers();
            }
            self.report_changes();
            round += 1;
            std::thread::sleep(ROUND);
        }
    }

    /// Logs the final counts.
    pub fn report_totals(&self) {
        for (pipeline, log) in self.pipelines.iter().zip(&self.logs) {
            let reading = pipeline.tally.read();
            info!(
                pipeline = pipeline.name,
                train = pipeline.train.0,
                used = reading.used,
                rejected = reading.rejected,
                lost = reading.lost,
                refused = refused_words(&refusals(&reading.refused)),
                status_changes = log.statuses.changes(),
                "stopped"
            );
        }
    }

    fn check_controllers(&mut self) {
        for (train, count) in &self.trains {
            let train = *train;
            // Before the look: what was begun by then is over when nobody is there.
            let begun = count.begun();
            let seen = match Peer::look_up(&self.host, train, Role::Controller) {
                Ok(Peer::Absent) => {
                    count.end(begun);
                    None
                }
                Ok(Peer::Compatible(peer) | Peer::Incompatible(peer)) => Some(peer),
                Err(error) => {
                    let error = error.to_string();
                    if self.failure.as_ref() != Some(&error) {
                        warn!(train = train.0, "{error}");
                        self.failure = Some(error);
                    }
                    continue;
                }
            };
            if self.controllers.get(&train) != Some(&seen) {
                report_controller(train, seen.as_ref());
                self.controllers.insert(train, seen);
            }
        }
    }

    fn report_changes(&mut self) {
        // Once for all pipelines of a train.
        let known = |(pipeline, last): (&WatchedPipeline, &TallyReading)| {
            Some((pipeline.train.0, last.implausible?.fault))
        };
        let mut reported: Vec<(u64, InputFault)> =
            self.pipelines.iter().zip(&self.readings).filter_map(known).collect();
        let now = Instant::now();
        let mut refused: HashMap<TrainId, [u32; REJECTION_REASONS]> = HashMap::new();
        let known = self.readings.iter_mut().zip(&mut self.logs);
        for (pipeline, (last, log)) in self.pipelines.iter().zip(known) {
            let reading = pipeline.tally.read();
            let (name, train) = (pipeline.name.as_str(), pipeline.train.0);
            log.report(name, train, &reading, now);
            if let Some(detected) = reading.implausible
                && !reported.contains(&(train, detected.fault))
            {
                reported.push((train, detected.fault));
                let code = detected.fault.name();
                warn!(train, code, "the samples cannot be true: {detected}");
            }
            if reading.lost > last.lost {
                let lost = reading.lost - last.lost;
                warn!(pipeline = name, train, lost, "samples lost");
            }
            if reading.unsent > last.unsent {
                let unsent = reading.unsent - last.unsent;
                warn!(pipeline = name, train, unsent, "snapshots the transport did not take");
            }
            let most = refused.entry(pipeline.train).or_insert([0; REJECTION_REASONS]);
            most.iter_mut().zip(reading.refused).for_each(|(most, it)| *most = it.max(*most));
            *last = reading;
        }
        for (train, counts) in refused {
            let new = self.refusals.entry(train).or_default().look(&counts, now);
            report_refusals(train, &new);
        }
    }
}

impl PipelineLog {
    fn new(now: Instant) -> Self {
        PipelineLog { statuses: StatusLog::new(now), suspects: StatusLog::new(now) }
    }

    /// Logs what is new of a pipeline's status and of what it suspects.
    fn report(&mut self, pipeline: &str, train: u64, reading: &TallyReading, now: Instant) {
        if let Some(untold) = self.statuses.look(reading.status, now) {
            report_status(pipeline, train, reading, &untold);
        }
        let suspect = reading.suspicion.map_or(0, |it| it.effect.map_or(u32::MAX, |it| it as u32));
        // Nothing suspected is no news before something is.
        if self.suspects.look((suspect, 0), now).is_none()
            || (suspect == 0 && self.suspects.changes() == 0)
        {
            return;
        }
        let Some(suspicion) = reading.suspicion else {
            info!(pipeline, train, "nothing is suspected any more");
            return;
        };
        let (suspect, force) = (suspicion.name(), suspicion.force());
        let near_km = reading.position_m.is_finite().then_some(1e-3 * reading.position_m);
        let near_km = near_km.map(|it| format!("{it:.3}"));
        let remedy = KindRow::of(suspicion.effect.unwrap_or(EffectKind::Unknown)).to_do;
        warn!(
            pipeline,
            train, suspect, force, near_km, "the model lacks a force: {suspicion}; to do: {remedy}"
        );
    }
}

/// A status that wants a person is a warning, with what to do; any other is information.
fn report_status(
    pipeline: &str,
    train: u64,
    reading: &TallyReading,
    untold: &[(StatusAndReason, u64)],
) {
    let words = |(status, reason): StatusAndReason| {
        let status = Status::from_number(status).unwrap_or(Status::Invalid);
        (status, Reason::from_number(reason).unwrap_or(Reason::None))
    };
    let (status, reason) = words(reading.status);
    // Changes to and fro that no line of their own reports.
    let untold: Vec<String> = untold
        .iter()
        .map(|&(state, count)| (words(state), count))
        .map(|((status, reason), count)| format!("{status} ({reason}) {count}"))
        .collect();
    let untold = (!untold.is_empty()).then(|| untold.join(", "));
    if Verdict::of(status, Some(reason)) == Verdict::Ok {
        info!(pipeline, train, %status, %reason, untold, "status");
        return;
    }
    let refused = refused_words(&refusals(&reading.refused));
    let refused = (reason == Reason::BadInput && !refused.is_empty()).then_some(refused);
    let (meaning, remedy) = (reason.meaning().trim().trim_end_matches('.'), of_reason(reason));
    warn!(pipeline, train, %status, %reason, untold, refused, "not to be relied on: {meaning}; to do: {remedy}");
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
