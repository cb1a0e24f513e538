//! Maintenance events that a learner writes down while a recording goes on.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use dynocar::models::{Store, TrainModels};
use dynocar_shared::TrainId;

use super::configuration::Configuration;
use crate::event::{Event, EventKind};

/// How often it is looked for new ones.
const EVERY: Duration = Duration::from_secs(5);

/// The store of a daemon's configuration, and how far its events are known.
#[derive(Default)]
pub struct Maintenance {
    trains: BTreeMap<TrainId, (TrainModels, u64)>,
    looked: Option<Instant>,
}

impl Maintenance {
    /// From now on the events of a train by the store of its daemon's configuration.
    pub fn follow(&mut self, train: TrainId, configuration: &Configuration) {
        let Some(directory) = configuration.store() else { return };
        let models = Store::at(&directory).train(train);
        // What was written down before the recording is none of it.
        let known = newest(&models);
        self.trains.entry(train).or_insert((models, known));
    }

    /// What is new since the last look; nothing more often than every few seconds.
    pub fn news(&mut self) -> Vec<Event> {
        if self.looked.is_some_and(|looked| looked.elapsed() < EVERY) {
            return Vec::new();
        }
        self.looked = Some(Instant::now());
        let mut news = Vec::new();
        for (train, (models, known)) in &mut self.trains {
            // One that cannot be read is reported by those who work on the store.
            let events = models.events().unwrap_or_default();
            for (number, found) in events.iter().filter(|(number, _)| number > known) {
                let text = format!("maintenance event {number}: {}", found.sentence);
                news.push(Event::now(*train, EventKind::MaintenanceFound, text));
            }
            *known = events.last().map_or(*known, |(number, _)| *number);
        }
        news
    }
}

fn newest(models: &TrainModels) -> u64 {
    let events = models.events().unwrap_or_default();
    events.last().map_or(0, |(number, _)| *number)
}
