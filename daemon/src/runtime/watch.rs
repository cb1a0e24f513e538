//! What the main thread does while the pipeline threads work.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dynocar_client::channel::SampleCount;
use dynocar_client::{Announcement, ChannelError, Host, Peer, Role};
use dynocar_core::plausibility::Slip;
use dynocar_shared::{Reason, Status, TrainId};
use tracing::{info, warn};

use super::status_log::StatusLog;
use super::tally::{Tally, TallyReading};

/// How often the main thread looks around.
const ROUND: Duration = Duration::from_millis(100);
/// Every so many rounds it looks who drives the trains.
const ROUNDS_PER_PEER_CHECK: u32 = 4;

/// A tally with the names it is logged under.
pub struct WatchedPipeline {
    /// The pipeline's name.
    pub name: String,
    /// The train.
    pub train: TrainId,
    /// What its thread counts.
    pub tally: Arc<Tally>,
}

/// Watches signals, peers and tallies, and writes what changes into the log.
pub struct Watch {
    host: Host,
    trains: Vec<(TrainId, Arc<SampleCount>)>,
    pipelines: Vec<WatchedPipeline>,
    readings: Vec<TallyReading>,
    statuses: Vec<StatusLog>,
    controllers: HashMap<TrainId, Option<Announcement>>,
}

impl Watch {
    /// A watch over the daemon's trains and pipelines.
    pub fn new(
        host: Host,
        trains: Vec<(TrainId, Arc<SampleCount>)>,
        pipelines: Vec<WatchedPipeline>,
    ) -> Self {
        let readings = vec![TallyReading::default(); pipelines.len()];
        let statuses = pipelines.iter().map(|_| StatusLog::new(Instant::now())).collect();
        Watch { host, trains, pipelines, readings, statuses, controllers: HashMap::new() }
    }

    /// Watches until a signal asks the daemon to stop, or a pipeline thread has ended.
    pub fn until_stopped(&mut self, stop: &AtomicBool, has_ended: impl Fn() -> bool) {
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
        for (pipeline, log) in self.pipelines.iter().zip(&self.statuses) {
            let reading = pipeline.tally.read();
            info!(
                pipeline = pipeline.name,
                train = pipeline.train.0,
                used = reading.used,
                rejected = reading.rejected,
                lost = reading.lost,
                status_changes = log.changes(),
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
                    warn!(train = train.0, "{error}");
                    None
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
            Some((pipeline.train.0, last.implausible?.slip))
        };
        let mut told: Vec<(u64, Slip)> =
            self.pipelines.iter().zip(&self.readings).filter_map(known).collect();
        let now = Instant::now();
        let known = self.readings.iter_mut().zip(&mut self.statuses);
        for (pipeline, (last, log)) in self.pipelines.iter().zip(known) {
            let reading = pipeline.tally.read();
            let (name, train) = (pipeline.name.as_str(), pipeline.train.0);
            if let Some(untold) = log.look(reading.status, now) {
                let status = Status::from_number(reading.status.0).unwrap_or(Status::Invalid);
                let reason = Reason::from_number(reading.status.1).unwrap_or(Reason::None);
                // Changes to and fro that no line tells.
                let untold = (untold > 0).then_some(untold);
                info!(pipeline = name, train, %status, %reason, untold, "status");
            }
            if let Some(finding) = reading.implausible
                && !told.contains(&(train, finding.slip))
            {
                told.push((train, finding.slip));
                let code = finding.slip.name();
                warn!(train, code, "the samples cannot be true: {finding}");
            }
            if reading.lost > last.lost {
                let lost = reading.lost - last.lost;
                warn!(pipeline = name, train, lost, "samples lost");
            }
            if reading.unsent > last.unsent {
                let unsent = reading.unsent - last.unsent;
                warn!(pipeline = name, train, unsent, "snapshots the transport did not take");
            }
            *last = reading;
        }
    }
}

fn report_controller(train: TrainId, controller: Option<&Announcement>) {
    let ours = Announcement::of_this_process(Role::Daemon);
    match controller {
        None => info!(train = train.0, "no controller"),
        Some(theirs) if theirs.is_compatible_with(&ours) => {
            info!(train = train.0, process = theirs.process_id, "controller connected");
        }
        Some(theirs) => {
            let error = ChannelError::IncompatiblePeer {
                train,
                theirs: Box::new(theirs.clone()),
                ours: Box::new(ours),
            };
            warn!(train = train.0, "{error}");
        }
    }
}
