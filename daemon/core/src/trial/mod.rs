//! Models on trial: which of several models predicts a train's motion better, judged while it runs.
//!
//! The model in force and its rivals predict the same samples open loop, restarted every 60 s
//! ([`OpenLoop`], by the simulation that judges every model, [`dynocar_model::simulate`]). Trip by trip
//! their errors are compared, and the comparison is a bet whose winnings say at every moment how sure one may be
//! ([`evidence`]): one may look as often as one likes. The errors by day and place are kept next to it ([`Ledger`]).
//!
//! This module knows no threads, files or clocks; `dynocar` runs it next to the pipelines.

pub mod evidence;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::Arc;

use dynocar_model::force::{ForceResolver, ResolvedSample, ValidSample};
use dynocar_model::simulate::{
    OpenLoopRecording, Prediction, QuadraticForces, Restart, SpeedError,
};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::{SampleField, TrainId, TrainSample};
use serde::{Deserialize, Serialize};

use crate::pipeline::Pipeline;
use crate::pipeline::admission::Admission;
use crate::pipeline::motion::MOVING_MPS;
use evidence::{RivalEvidence, score};

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

/// Moving time in s from which a trip is long enough to compare models; shorter trips join the next.
const TRIP_MIN_S: f64 = 120.0;
/// A controller that counts no trips is compared anew every this many s of motion.
const TRIP_MAX_S: f64 = 1800.0;

/// A model on trial.
pub struct Rival {
    /// Hash of the model.
    pub model: u64,
    /// The configured pipelines, with this model.
    pub pipelines: Vec<Pipeline>,
    /// Evidence of the trips for it, against the model in force.
    pub evidence: RivalEvidence,
    /// Errors of the model.
    pub ledger: Ledger,
    /// The score of the newest trip that was compared.
    pub newest_score: Option<f64>,
    open_loop: OpenLoop,
    /// Over the trip that goes on.
    trip: TripError,
    /// Whether it was there when that trip began.
    is_whole: bool,
}

impl Rival {
    /// Returns a model on trial with the evidence and errors that are known already.
    pub fn new(
        model: u64,
        open_loop: OpenLoop,
        pipelines: Vec<Pipeline>,
        (evidence, ledger): (RivalEvidence, Ledger),
    ) -> Self {
        let trip = TripError::default();
        Rival {
            model,
            pipelines,
            evidence,
            ledger,
            newest_score: None,
            open_loop,
            trip,
            is_whole: false,
        }
    }

    fn take(&mut self, sample: &TrainSample, valid: Option<&ValidSample>) {
        for pipeline in &mut self.pipelines {
            pipeline.process(sample);
        }
        if let Some(valid) = valid {
            self.open_loop.take(valid);
        }
    }
}

/// Prediction error of a model in the windows of a trip.
#[derive(Clone, Copy, Debug, Default)]
struct TripError {
    speed: SpeedError,
    distance_squares: f64,
    windows: f64,
}

impl TripError {
    fn add(&mut self, window: WindowError) {
        self.speed = self.speed + window.speed;
        self.distance_squares += window.distance_error_mps * window.distance_error_mps;
        self.windows += 1.0;
    }

    /// In (m/s)², of speed and distance together; `None` without a moving sample.
    fn mean_square(self) -> Option<f64> {
        let of_speed = self.speed.rmse_mps()?;
        Some(of_speed * of_speed + self.distance_squares / self.windows)
    }
}

/// The window that goes on.
#[derive(Clone, Copy)]
struct Window {
    begin_ns: i64,
    segment: u32,
    first_m: Option<f64>,
    last_m: Option<f64>,
}

/// One train's models on trial, by the samples of its controller.
pub struct ModelTrials {
    admission: Admission,
    /// The model in force. Its evidence is against itself and stays empty; its pipelines run
    /// elsewhere.
    pub in_force: Rival,
    /// The others; one that is added is compared from the next trip on.
    pub rivals: Vec<Rival>,
    window: Option<Window>,
    run: Option<u32>,
    moved_s: f64,
}

impl ModelTrials {
    /// Of a train.
    pub fn new(train: TrainId, in_force: Rival, rivals: Vec<Rival>) -> Self {
        let admission = Admission::new(train, in_force.open_loop.train.clone());
        let mut trials =
            ModelTrials { admission, in_force, rivals, window: None, run: None, moved_s: 0.0 };
        trials.begin_trip();
        trials
    }

    /// Takes the next sample; `unix_s` is the time of day, in s since 1970. True when a trip ended
    /// by it, and with it the models were compared.
    pub fn take(&mut self, sample: &TrainSample, unix_s: f64) -> bool {
        let valid = self.admission.validate(sample).ok();
        let mut has_compared = false;
        if let Some(valid) = &valid {
            let ends = self.window.is_some_and(|window| {
                let length_ns = valid.sample.time_ns.saturating_sub(window.begin_ns);
                window.segment != valid.segment || length_ns as f64 * 1e-9 >= Restart::WINDOW_S
            });
            if ends {
                self.close_window(unix_s);
            }
            let is_next_trip = self.run.is_some_and(|run| run != sample.run);
            self.run = Some(sample.run);
            if self.moved_s >= if is_next_trip { TRIP_MIN_S } else { TRIP_MAX_S } {
                self.compare();
                has_compared = true;
            }
            self.moved_s += if valid.sample.speed_mps > MOVING_MPS { valid.step_s } else { 0.0 };
            let position_m = sample.get(SampleField::Position);
            let window = self.window.get_or_insert(Window {
                begin_ns: sample.time_ns,
                segment: valid.segment,
                first_m: position_m,
                last_m: position_m,
            });
            window.last_m = position_m;
        }
        for model in self.models() {
            model.take(sample, valid.as_ref());
        }
        has_compared
    }

    /// A rival goes into force, and the model in force becomes a rival in its place. The measured errors of both stay,
    /// the comparison begins anew.
    pub fn change(&mut self, index: usize) {
        std::mem::swap(&mut self.in_force, &mut self.rivals[index]);
        for model in self.models() {
            model.evidence = RivalEvidence::new(model.evidence.least_gain());
        }
        self.begin_trip();
    }

    /// Every model that is there takes part in the trip from here on.
    fn begin_trip(&mut self) {
        for model in self.models() {
            (model.trip, model.is_whole) = (TripError::default(), true);
        }
        self.moved_s = 0.0;
    }

    fn models(&mut self) -> impl Iterator<Item = &mut Rival> {
        std::iter::once(&mut self.in_force).chain(&mut self.rivals)
    }

    fn close_window(&mut self, unix_s: f64) {
        let Some(window) = self.window.take() else { return };
        let middle_m = window.first_m.zip(window.last_m).map(|(first, last)| 0.5 * (first + last));
        for model in self.models() {
            let error = model.open_loop.close();
            model.ledger.book(error.speed, unix_s, middle_m);
            model.trip.add(error);
        }
    }

    fn compare(&mut self) {
        let in_force = self.in_force.trip.mean_square();
        for rival in self.rivals.iter_mut().filter(|rival| rival.is_whole) {
            if let Some((in_force, own)) = in_force.zip(rival.trip.mean_square()) {
                let score = score(in_force, own);
                rival.evidence.take(score);
                rival.newest_score = Some(score);
            }
        }
        self.begin_trip();
    }
}

#[cfg(test)]
mod ledger_tests {
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
