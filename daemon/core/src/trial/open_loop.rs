//! The open-loop error of one model over windows of 60 s, while the train runs.

use std::sync::Arc;

use dynocar_model::force::{ForceResolver, ResolvedSample, ValidSample};
use dynocar_model::simulate::{
    OpenLoopRecording, Prediction, QuadraticForces, Restart, SpeedError,
};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;

/// Samples nearer in time, in s, to the last that was kept are not: 20 a second describe a motion.
const STEP_MIN_S: f64 = 0.05;
/// Largest number of samples in a window.
const SAMPLES_MAX: usize = (Restart::WINDOW_S / STEP_MIN_S) as usize + 2;

/// Prediction error of a model in one window.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WindowError {
    /// Of the speed, over the window's moving samples.
    pub speed: SpeedError,
    /// Of the distance by the predicted speed against the distance by position, over the window's length, in
    /// m/s; what a wrong wheel diameter shows. 0 where no position is known.
    pub distance_error_mps: f64,
}

/// Predicts by one model what the samples of a window should show.
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

    /// Ends the window: what the model leaves of it, nothing where nothing can be simulated.
    pub fn close(&mut self) -> WindowError {
        let samples = std::mem::replace(&mut self.samples, Vec::with_capacity(SAMPLES_MAX));
        let Ok(recording) = OpenLoopRecording::new(samples) else {
            return WindowError::default();
        };
        let forces = QuadraticForces::declared(&recording, self.train.resistance);
        self.prediction.simulate(&recording, &forces, Restart::FullRun);
        WindowError {
            speed: SpeedError::of(&recording, &self.prediction),
            distance_error_mps: distance_error_mps(&recording, self.prediction.speed_mps())
                .unwrap_or(0.0),
        }
    }
}

/// The difference of the distances over the time that they took; `None` where they cannot be compared.
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
