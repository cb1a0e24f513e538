//! What the trials show now, for those who watch the daemon: the metrics.

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
    pub capital: f64,
}

/// Where the shadow's thread pins up its figures, and others read them.
#[derive(Clone, Debug, Default)]
pub struct Board {
    figures: Arc<Mutex<Vec<TrialFigures>>>,
}

impl Board {
    /// Replaces the figures of a train.
    pub fn pin(&self, train: u64, figures: Vec<TrialFigures>) {
        let mut all = self.figures.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|it| it.train != train);
        all.extend(figures);
    }

    /// The figures of all trains.
    pub fn read(&self) -> Vec<TrialFigures> {
        self.figures.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
