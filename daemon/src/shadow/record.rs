//! Measurements of a train's trials: a file in the folder of its models, which outlives the daemon, and the present
//! figures in the metrics.
//!
//! `trials.json` is replaced as a whole. A daemon that starts takes up the errors of each model, and the evidence for a
//! rival against the same model in force.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use dynocar_core::trial::Ledger;
use dynocar_core::trial::evidence::{RATIO_MAX, RivalEvidence};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{Parameter, ParameterSnapshot};
use serde::{Deserialize, Serialize};
use tracing::warn;

use crate::models::{ModelHash, UtcSecond};
use crate::storage::{Disk, Rights, StorageError, replace};

/// The file, in a train's folder of the store.
pub const TRIALS_FILE: &str = crate::models::store::TRIALS_FILE;
/// Number of models whose errors are kept: those tried last.
const MODELS_MAX: usize = 32;

/// Estimate of a rival's pipeline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RivalEstimate {
    /// The pipeline's name.
    pub pipeline: String,
    /// Its status.
    pub status: String,
    /// Parameters with value and standard deviation.
    pub values: Vec<(String, f64, f64)>,
    /// The effect that a residual monitor suspects with this model; empty for none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub suspects: String,
}

impl RivalEstimate {
    /// Returns the estimate of a snapshot of a pipeline.
    pub fn new(pipeline: &str, snapshot: &ParameterSnapshot) -> Self {
        let count = snapshot.parameter_count as usize;
        let values = snapshot.parameters.iter().take(count).enumerate().map(|(index, &number)| {
            let name = Parameter::from_number(number).map_or("unknown", Parameter::name);
            let std = snapshot.covariance_at(index, index).max(0.0).sqrt();
            (name.to_owned(), snapshot.values[index], std)
        });
        let suspect = EffectKind::from_number(snapshot.suspected_effect);
        let suspect = suspect.filter(|&kind| kind != EffectKind::None);
        RivalEstimate {
            pipeline: pipeline.into(),
            status: snapshot.status().to_string(),
            values: values.collect(),
            suspects: suspect.map_or(String::new(), |kind| kind.to_string()),
        }
    }
}

/// A model that is or was on trial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TriedModel {
    /// The model.
    pub model: ModelHash,
    /// When a sample was last predicted by it.
    pub last: UtcSecond,
    /// The model in force that it is compared with, while it is on trial.
    pub against: Option<ModelHash>,
    /// Its open-loop error over 60 s, in m/s, in all.
    pub error_mps: Option<f64>,
    /// Its error over that of the model in force: an interval that holds the truth at all times
    /// at once with 95 %.
    pub error_ratio: Option<[f64; 2]>,
    /// Evidence of the trips for it against the model in force.
    pub evidence: RivalEvidence,
    /// Its errors by day and place.
    pub ledger: Ledger,
    /// Estimates of its pipelines.
    #[serde(default)]
    pub estimates: Vec<RivalEstimate>,
}

/// An interval of [`RivalEvidence::error_ratio`] in words that go before "the error of …".
pub fn ratio_in_words([low, high]: [f64; 2]) -> String {
    match (low < 0.005, high >= RATIO_MAX) {
        (false, false) => format!("{low:.2} to {high:.2} times"),
        (true, false) => format!("at most {high:.2} times"),
        (false, true) => format!("at least {low:.2} times"),
        (true, true) => "nobody knows yet how many times".into(),
    }
}

/// The trials of a train.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrialRecord {
    /// The model in force.
    pub in_force: Option<ModelHash>,
    /// The models that are on trial, and those that were.
    pub models: Vec<TriedModel>,
}

impl TrialRecord {
    /// Reads the file of an earlier daemon in a train's folder; empty where there is none, or where it cannot be
    /// read, which is logged.
    pub fn read(folder: &Path) -> Self {
        let path = folder.join(TRIALS_FILE);
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return TrialRecord::default();
            }
            Err(error) => {
                warn!("{}: {error}; the trials begin anew", path.display());
                return TrialRecord::default();
            }
        };
        serde_json::from_str(&text).unwrap_or_else(|error| {
            warn!("{}: no record of trials: {error}; the trials begin anew", path.display());
            TrialRecord::default()
        })
    }

    /// Replaces the file in a train's folder.
    ///
    /// # Errors
    ///
    /// The system's answer; the old file stays.
    pub fn write(&self, folder: &Path) -> Result<(), StorageError> {
        let text = serde_json::to_string_pretty(self).unwrap_or_default();
        let (path, beside): (PathBuf, PathBuf) =
            (folder.join(TRIALS_FILE), folder.join(format!(".{TRIALS_FILE}.part")));
        replace(&Disk, &path, &beside, (text.as_bytes(), &Rights::Usual))
    }

    /// Returns the trial of a model.
    pub fn of(&self, model: ModelHash) -> Option<&TriedModel> {
        self.models.iter().find(|it| it.model == model)
    }

    /// Takes over the present results of models on trial; others stay as they were.
    pub fn update(&mut self, in_force: ModelHash, now: Vec<TriedModel>) {
        self.in_force = Some(in_force);
        for tried in now {
            match self.models.iter_mut().find(|it| it.model == tried.model) {
                Some(known) => *known = tried,
                None => self.models.push(tried),
            }
        }
        while self.models.len() > MODELS_MAX {
            let oldest = (0..self.models.len()).min_by_key(|&place| self.models[place].last);
            oldest.map(|place| self.models.remove(place));
        }
    }
}

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
    /// Replaces the published figures of a train.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_that_shows_nothing_is_not_shown_as_a_number() {
        assert_eq!(ratio_in_words([0.42, 0.55]), "0.42 to 0.55 times");
        assert_eq!(ratio_in_words([0.0, 0.55]), "at most 0.55 times");
        assert_eq!(ratio_in_words([1.2, RATIO_MAX]), "at least 1.20 times");
        assert!(!ratio_in_words([0.0, RATIO_MAX]).contains(char::is_numeric));
    }
}
