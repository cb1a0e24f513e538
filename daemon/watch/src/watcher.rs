//! The observed trains, and the state of each that is shown.

use std::mem::take;
use std::time::{Duration, Instant};

use dynocar::config::{DaemonConfig, PipelineConfig};
use dynocar::observing::{ObservedSelection, ObservedTrain};
use dynocar_shared::TrainId;
use dynocar_transport::{Host, Role, monotonic_now_ns};

use super::state::PlotHistory;
use crate::state::{Advisor, Daemon, PipelineState, TrainState};

/// Time between two searches for daemons, and between two points of the plots.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// Time between two computations of the next manoeuvre.
const ADVISE_EVERY: Duration = Duration::from_secs(5);

/// Watches trains.
pub struct Watcher {
    wanted: ObservedSelection,
    config: Option<DaemonConfig>,
    watched: Vec<Watched>,
    last_look: Option<Instant>,
    last_advice: Option<Instant>,
}

/// One train.
struct Watched {
    state: TrainState,
    observed: ObservedTrain,
    advisor: Advisor,
}

impl Watcher {
    /// Returns a watcher of these trains.
    pub fn new(wanted: ObservedSelection, config: Option<DaemonConfig>) -> Self {
        let named = wanted.trains.clone();
        let watched = Vec::new();
        let mut watcher = Watcher { wanted, config, watched, last_look: None, last_advice: None };
        named.into_iter().for_each(|train| watcher.add(train));
        watcher
    }

    /// Returns where daemons are looked for, in words.
    pub fn place(&self) -> String {
        self.wanted.host.root().display().to_string()
    }

    /// Returns the trains as they are now.
    pub fn trains(&self) -> Vec<&TrainState> {
        self.watched.iter().map(|it| &it.state).collect()
    }

    /// Takes the new snapshots; call it some times a second.
    pub fn look(&mut self) {
        let is_due = |last: Option<Instant>, every| last.is_none_or(|it| it.elapsed() >= every);
        let is_second = is_due(self.last_look, LOOK_EVERY);
        if is_second {
            self.last_look = Some(Instant::now());
            self.find_trains();
        }
        let pipelines = self.config.as_ref().map_or(&[][..], |config| &config.pipelines);
        for watched in &mut self.watched {
            if is_second {
                watched.look_up(&self.wanted.host);
            }
            watched.poll(pipelines, is_second);
        }
        if is_due(self.last_advice, ADVISE_EVERY) && self.watched.iter().any(Watched::is_heard) {
            self.last_advice = Some(Instant::now());
            for watched in &mut self.watched {
                watched.state.advice = watched.advisor.advise(&watched.state);
            }
        }
    }

    fn find_trains(&mut self) {
        let is_known = |train| self.watched.iter().any(|it| it.state.id == train);
        // A directory that cannot be read now may be read in a second.
        let newcomers = self.wanted.newcomers(&[Role::Daemon], is_known).unwrap_or_default();
        newcomers.into_iter().for_each(|train| self.add(train));
        if self.wanted.trains.is_empty() {
            self.watched.sort_by_key(|it| it.state.id);
        }
    }

    fn add(&mut self, train: TrainId) {
        let mut declared = self.config.iter().flat_map(|config| &config.trains);
        let model = declared.find(|it| it.id == train).map(|it| it.model.clone());
        let name = model.as_ref().map(|model| model.name.clone());
        self.watched.push(Watched {
            state: TrainState::new(train, name),
            observed: ObservedTrain::new(train),
            advisor: Advisor::new(model),
        });
    }
}

impl Watched {
    fn is_heard(&self) -> bool {
        !self.state.pipelines.is_empty()
    }

    /// Looks who serves the train.
    fn look_up(&mut self, host: &Host) {
        let looked = self.observed.look(host, &mut Vec::new());
        self.state.daemon = match (looked, self.observed.daemon()) {
            (Err(error), _) => Daemon::Unreadable(error.to_string()),
            (Ok(()), Some(it)) => {
                Daemon::Serving { version: it.version.clone(), process_id: it.process_id }
            }
            (Ok(()), None) if self.is_heard() => Daemon::Gone,
            (Ok(()), None) => Daemon::Absent,
        };
    }

    fn poll(&mut self, names: &[PipelineConfig], is_second: bool) {
        self.observed.poll();
        let now_ns = monotonic_now_ns();
        for reading in self.observed.readings(now_ns) {
            let index = reading.snapshot.pipeline_index;
            let pipelines = &mut self.state.pipelines;
            let place = pipelines.iter().position(|it| it.snapshot.pipeline_index >= index);
            let place = place.unwrap_or(pipelines.len());
            match pipelines.get_mut(place).filter(|it| it.snapshot.pipeline_index == index) {
                Some(known) => {
                    let (name, history) = (take(&mut known.name), take(&mut known.history));
                    *known = PipelineState::new(Some(name), history, &reading, now_ns);
                }
                None => {
                    let name = names.get(index as usize).map(|it| it.name.clone());
                    let new = PipelineState::new(name, PlotHistory::default(), &reading, now_ns);
                    pipelines.insert(place, new);
                }
            }
            if is_second {
                pipelines[place].history.push(reading.snapshot, now_ns);
            }
        }
        let epoch = self.state.pipelines.iter().map(|it| it.snapshot.epoch).max();
        self.state.up_s = epoch.map(|epoch| 1e-9 * now_ns.saturating_sub(epoch as i64) as f64);
        if is_second {
            self.advisor.see(&self.state);
        }
    }
}
