//! The thread that writes the states: an observer of the daemon's own snapshots.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dynocar_core::pipeline::KeptEstimate;
use dynocar_shared::ParameterSnapshot;
use dynocar_transport::{ChannelError, Host, monotonic_now_ns};
use tracing::{info, warn};

use super::entry::{ModelKey, StateContent, StoredEstimate, settings_hash};
use super::{StateError, StateProblem, file, path_of};
use crate::config::DaemonConfig;
use crate::observing::ObservedTrain;
use crate::stamp::Stamp;

/// Time between two checks whether to stop.
const ROUND: Duration = Duration::from_millis(50);
/// Time between two writings of the state for a daemon that dies at once.
const LEAVE_EVERY: Duration = Duration::from_secs(1);

/// One train's state with the snapshots from which it is made.
struct KeptTrain {
    observed: ObservedTrain,
    content: StateContent,
    /// Whether the file is older than the content: the one on the disk, and the one in the run-time directory.
    is_changed: [bool; 2],
}

/// Keeps the states of all trains.
pub struct StateKeeper {
    /// On the disk, and in the run-time directory.
    directories: [PathBuf; 2],
    interval: Duration,
    /// Name and settings hash by number of the pipeline.
    pipelines: Vec<(String, u64)>,
    trains: Vec<KeptTrain>,
    stop: Arc<AtomicBool>,
}

impl StateKeeper {
    /// Returns a keeper that writes into the directory so often; `stored` holds the estimates in the trains' states at
    /// the start, by index of the train.
    ///
    /// # Errors
    ///
    /// When the snapshots cannot be read.
    pub fn new(
        config: &DaemonConfig,
        (directory, interval): (PathBuf, Duration),
        host: &Host,
        stored: Vec<Vec<StoredEstimate>>,
        stop: Arc<AtomicBool>,
    ) -> Result<Self, ChannelError> {
        let trains = config
            .trains
            .iter()
            .zip(stored)
            .map(|(train, estimates)| {
                Ok(KeptTrain {
                    observed: ObservedTrain::open(host, train.id)?,
                    content: StateContent { key: ModelKey::from_train(train), estimates },
                    is_changed: [false; 2],
                })
            })
            .collect::<Result<_, ChannelError>>()?;
        let name =
            |it: &crate::config::PipelineConfig| (it.name.clone(), settings_hash(&it.estimator));
        let pipelines = config.pipelines.iter().map(name).collect();
        let directories = [directory, host.root().to_owned()];
        Ok(StateKeeper { directories, interval, pipelines, trains, stop })
    }

    /// Writes the validated estimates, every so often and at the end, when the copies in the run-time directory are
    /// removed.
    pub fn run(&mut self) {
        let (mut last, mut left) = (Instant::now(), Instant::now());
        while !self.stop.load(Ordering::Relaxed) {
            std::thread::sleep(ROUND);
            if last.elapsed() >= self.interval {
                last = Instant::now();
                self.gather();
                self.write(0, file::replace);
            } else if left.elapsed() >= LEAVE_EVERY {
                left = Instant::now();
                self.gather();
                self.write(1, file::leave);
            } else {
                for train in &mut self.trains {
                    train.observed.poll();
                }
            }
        }
        self.gather();
        self.write(0, file::replace);
        for train in self.trains.iter().filter(|it| !it.is_changed[0]) {
            let id = dynocar_shared::TrainId(train.content.key.train);
            // A copy that was never left cannot be removed.
            let _ = std::fs::remove_file(path_of(&self.directories[1], id));
        }
    }

    fn gather(&mut self) {
        let (now, now_ns) = (Stamp::now(), monotonic_now_ns());
        for train in &mut self.trains {
            train.observed.poll();
            for reading in train.observed.readings(now_ns) {
                let index = reading.snapshot.pipeline_index as usize;
                if reading.snapshot.model_hash != train.content.key.model {
                    // Another model is in force: the estimates for the one before no longer hold.
                    train.content.key.model = reading.snapshot.model_hash;
                    train.content.estimates.clear();
                }
                if let Some((name, settings)) = self.pipelines.get(index) {
                    let is_news = keep(&mut train.content, name, *settings, reading.snapshot, &now);
                    train.is_changed = train.is_changed.map(|is_changed| is_changed || is_news);
                }
            }
        }
    }

    fn write(&mut self, place: usize, replace: fn(&Path, &str) -> Result<(), StateError>) {
        for train in self.trains.iter_mut().filter(|train| train.is_changed[place]) {
            let id = dynocar_shared::TrainId(train.content.key.train);
            let path = path_of(&self.directories[place], id);
            let written = train
                .content
                .to_text()
                .map_err(|error| StateProblem::Malformed(error.to_string()).at(&path))
                .and_then(|text| replace(&path, &text));
            match written {
                Ok(()) => train.is_changed[place] = false,
                Err(error) => warn!("state not kept, tried again later: {error}"),
            }
        }
    }
}

/// Takes a validated estimate into the state; true when it is another than before. An estimate that is not validated
/// leaves the older one, with its older time, in the state.
fn keep(
    content: &mut StateContent,
    pipeline: &str,
    settings: u64,
    snapshot: &ParameterSnapshot,
    now: &Stamp,
) -> bool {
    let Ok(estimate) = KeptEstimate::from_snapshot(snapshot) else { return false };
    let stored = StoredEstimate {
        train: content.key.train,
        pipeline: pipeline.to_owned(),
        settings,
        estimated: now.clone(),
        estimate,
    };
    match content.estimates.iter_mut().find(|it| it.pipeline == pipeline) {
        Some(before)
            if before.estimate.has_values_of(&stored.estimate) && before.settings == settings =>
        {
            // The same again, without a sample since: it does not become younger by that.
            false
        }
        Some(before) => {
            *before = stored;
            true
        }
        None => {
            info!(pipeline, train = content.key.train, "first validated estimate, to be kept");
            content.estimates.push(stored);
            true
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_shared::{Parameter, Status};

    fn snapshot(status: Status, mass_t: f64) -> ParameterSnapshot {
        let mut snapshot = ParameterSnapshot::empty();
        snapshot.status = status as u32;
        snapshot.parameter_count = 1;
        snapshot.parameters[0] = Parameter::Mass as u32;
        (snapshot.values[0], snapshot.covariance[0]) = (mass_t, 1.0);
        snapshot
    }

    #[test]
    fn only_validated_estimates_replace_what_is_kept() {
        let key = ModelKey { train: 1, wheel_set: String::new(), model: 2 };
        let mut content = StateContent { key, estimates: Vec::new() };
        let mut offer = |status, mass_t, unix_s| {
            let now = Stamp { unix_s, since_boot: None };
            let news = keep(&mut content, "mass", 5, &snapshot(status, mass_t), &now);
            let kept = content.estimates.first();
            (news, kept.map(|it| (it.estimate.values()[0], it.estimated.unix_s)))
        };
        assert_eq!(offer(Status::Unestimated, 100.0, 1.0), (false, None));
        assert_eq!(offer(Status::Estimated, 200.0, 2.0), (true, Some((200.0, 2.0))));
        assert_eq!(offer(Status::Degraded, 300.0, 3.0), (false, Some((200.0, 2.0))));
        assert_eq!(offer(Status::Estimated, 200.0, 4.0), (false, Some((200.0, 2.0))), "no news");
        assert_eq!(offer(Status::Estimated, 201.0, 5.0), (true, Some((201.0, 5.0))));
    }
}
