//! The model in force and its rivals on the same samples.

use dynocar_model::force::ValidSample;
use dynocar_model::simulate::{Restart, SpeedError};
use dynocar_shared::{SampleField, TrainId, TrainSample};

use super::evidence::{RivalEvidence, score};
use super::ledger::{Ledger, OpenLoop, WindowError};
use crate::pipeline::Pipeline;
use crate::pipeline::admission::Admission;
use crate::pipeline::motion::MOVING_MPS;

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
