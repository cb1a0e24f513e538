//! Open-loop errors of a model: over windows of 60 s while the train runs, and by day and place, within bounded memory.

use std::collections::BTreeMap;
use std::sync::Arc;

use dynocar_model::force::{ForceResolver, ResolvedSample, ValidSample};
use dynocar_model::simulate::{
    OpenLoopRecording, Prediction, QuadraticForces, Restart, SpeedError,
};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use serde::{Deserialize, Serialize};

/// Days that are kept, the newest.
const DAYS_MAX: usize = 400;
/// Length of a place along the line in m.
pub const PLACE_M: f64 = 1000.0;
/// Places that are kept, the first that were passed.
const PLACES_MAX: usize = 2000;
const DAY_S: f64 = 86_400.0;

/// A sum of squares in (m/s)² and the samples behind it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sum {
    /// Sum of squares in (m/s)².
    pub squares: f64,
    /// Moving samples.
    pub samples: u64,
}

impl Sum {
    fn add(&mut self, error: SpeedError) {
        self.squares += error.sum_of_squares;
        self.samples += error.count as u64;
    }

    /// Returns the root mean square in m/s; `None` without samples.
    pub fn rmse_mps(&self) -> Option<f64> {
        (self.samples > 0).then(|| (self.squares / self.samples as f64).sqrt())
    }
}

/// Where and when a model erred.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ledger {
    /// All of it.
    pub all: Sum,
    /// By day, counted from 1970.
    pub days: BTreeMap<i64, Sum>,
    /// By place: chainage in units of [`PLACE_M`], rounded down.
    pub places: BTreeMap<i64, Sum>,
}

impl Ledger {
    /// Books the error over a window that ended at a time in s since 1970; `position_m` is the
    /// chainage of its middle, where it is known.
    pub fn book(&mut self, error: SpeedError, unix_s: f64, position_m: Option<f64>) {
        self.all.add(error);
        self.days.entry((unix_s / DAY_S).floor() as i64).or_default().add(error);
        while self.days.len() > DAYS_MAX {
            self.days.pop_first();
        }
        if let Some(position_m) = position_m {
            let place = (position_m / PLACE_M).floor() as i64;
            if self.places.len() < PLACES_MAX || self.places.contains_key(&place) {
                self.places.entry(place).or_default().add(error);
            }
        }
    }
}

/// Samples nearer in time, in s, to the last that was kept are not: 20 a second describe a motion.
const STEP_MIN_S: f64 = 0.05;
/// Largest number of samples in a window.
const SAMPLES_MAX: usize = (Restart::WINDOW_S / STEP_MIN_S) as usize + 2;

/// Prediction error of a model in one window.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WindowError {
    /// Of the speed, over the window's moving samples.
    pub speed: SpeedError,
    /// Of the distance by the predicted speed against the distance by position, over the window's length, in m/s; it
    /// shows a wrong wheel diameter. 0 where no position is known.
    pub distance_error_mps: f64,
}

/// Predicts the samples of a window by one model.
pub struct OpenLoop {
    pub(super) train: Arc<TrainModel>,
    resolver: ForceResolver,
    samples: Vec<ResolvedSample>,
    prediction: Prediction,
}

impl OpenLoop {
    /// For a train on a line, as a pipeline's forces are.
    pub fn new(train: Arc<TrainModel>, track: Option<Arc<Track>>) -> Self {
        OpenLoop {
            resolver: ForceResolver::new(Arc::clone(&train), track),
            train,
            samples: Vec::with_capacity(SAMPLES_MAX),
            prediction: Prediction::new(),
        }
    }

    /// Takes the next sample of the window.
    pub fn take(&mut self, valid: &ValidSample) {
        let resolved = self.resolver.resolve(valid);
        let is_near = self.samples.last().is_some_and(|last| {
            let step_ns = resolved.time_ns - last.time_ns;
            (step_ns as f64) < 0.999e9 * STEP_MIN_S
        });
        if !is_near && self.samples.len() < SAMPLES_MAX {
            self.samples.push(resolved);
        }
    }

    /// Ends the window and returns the error of the model over it, 0 where nothing can be simulated.
    pub fn close(&mut self) -> WindowError {
        let samples = std::mem::replace(&mut self.samples, Vec::with_capacity(SAMPLES_MAX));
        let Ok(recording) = OpenLoopRecording::new(samples) else {
            return WindowError::default();
        };
        let forces = QuadraticForces::declared(&recording, self.train.resistance);
        self.prediction.simulate(&recording, &forces, Restart::FullRun);
        WindowError {
            speed: SpeedError::new(&recording, &self.prediction),
            distance_error_mps: distance_error_mps(&recording, self.prediction.speed_mps())
                .unwrap_or(0.0),
        }
    }
}

/// Returns the difference of the distances over the time that they took; `None` where they cannot be compared.
fn distance_error_mps(recording: &OpenLoopRecording, predicted_mps: &[f64]) -> Option<f64> {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let (first, last) = (samples.first()?, samples.last()?);
    let driven_s = time_s.last().copied().filter(|&driven_s| driven_s > 0.0)?;
    let is_whole = recording.restarts() == 0 && first.direction == last.direction;
    let measured_m = first.direction * (last.position_m? - first.position_m?);
    let steps = time_s.windows(2).zip(predicted_mps.windows(2));
    let predicted_m: f64 =
        steps.map(|(time_s, mps)| 0.5 * (time_s[1] - time_s[0]) * (mps[0] + mps[1])).sum();
    is_whole.then_some((predicted_m - measured_m) / driven_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_and_places_stay_bounded_and_nothing_of_the_whole_is_lost() {
        let mut ledger = Ledger::default();
        for k in 0..5000 {
            let error = SpeedError { sum_of_squares: 2.0, count: 8 };
            ledger.book(error, f64::from(k) * DAY_S, Some(f64::from(k) * PLACE_M + 1.0));
        }
        assert_eq!((ledger.days.len(), ledger.places.len()), (DAYS_MAX, PLACES_MAX));
        assert_eq!(ledger.days.last_key_value().unwrap().0, &4999);
        assert_eq!((ledger.all.samples, ledger.all.rmse_mps()), (40_000, Some(0.5)));
    }
}
