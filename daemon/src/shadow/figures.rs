//! Present figures of the trials, for those who watch the daemon: the metrics.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::models::ModelHash;

/// One model of one train.
#[derive(Clone, Debug, PartialEq)]
pub struct TrialFigures {
    /// The train.
    pub train: u64,
    /// The model.
    pub model: ModelHash,
    /// Whether it is in force.
    pub is_in_force: bool,
    /// Its open-loop error over 60 s, in m/s.
    pub error_mps: Option<f64>,
    /// Its error over that of the model in force: the interval's ends.
    pub error_ratio: Option<[f64; 2]>,
    /// Trips that were compared.
    pub trips: u64,
    /// The evidence for it, see [`dynocar_core::trial::evidence`].
    pub e_value: f64,
}

/// Maintenance events of a kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EventCount {
    /// The train.
    pub train: u64,
    /// The kind.
    pub kind: String,
    /// How many the store holds.
    pub count: u64,
}

/// Published figures.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pinned {
    /// The models of all trains.
    pub models: Vec<TrialFigures>,
    /// The maintenance events of all trains.
    pub events: Vec<EventCount>,
}

/// Where the shadow's thread pins up its figures, and others read them.
#[derive(Clone, Debug, Default)]
pub struct Board {
    pinned: Arc<Mutex<Pinned>>,
}

impl Board {
    /// Replaces what is pinned up of a train.
    pub fn pin(&self, train: u64, models: Vec<TrialFigures>, events: &BTreeMap<String, u64>) {
        let mut pinned = self.pinned.lock().unwrap_or_else(PoisonError::into_inner);
        pinned.models.retain(|it| it.train != train);
        pinned.models.extend(models);
        pinned.events.retain(|it| it.train != train);
        let counts = events.iter().map(|(kind, &count)| (kind.clone(), count));
        pinned.events.extend(counts.map(|(kind, count)| EventCount { train, kind, count }));
    }

    /// Returns the published figures of all trains.
    pub fn read(&self) -> Pinned {
        self.pinned.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
