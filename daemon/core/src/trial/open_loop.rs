//! The open-loop error of one model over windows of 60 s, while the train runs.

use std::sync::Arc;

use crate::force::{ForceResolver, ResolvedSample};
use crate::simulate::{BridgeLimits, Prediction, QuadraticForces, Recording, Restart, SpeedError};
use crate::track::Track;
use crate::train::TrainModel;
use crate::validation::ValidSample;

/// Samples nearer in time, in s, to the last that was kept are not: 20 a second tell a motion.
const STEP_MIN_S: f64 = 0.05;
/// Length of a window in s, as that of [`Restart::WINDOW_60`].
pub const WINDOW_S: f64 = 60.0;
/// A window holds at most so many samples.
const SAMPLES_MAX: usize = (WINDOW_S / STEP_MIN_S) as usize + 2;

/// Predicts by one model what the samples of a window should show.
pub struct OpenLoop {
    train: Arc<TrainModel>,
    resolver: ForceResolver,
    samples: Vec<ResolvedSample>,
    forces: QuadraticForces,
    prediction: Prediction,
}

impl OpenLoop {
    /// For a train on a line, as a pipeline's forces are.
    pub fn new(train: Arc<TrainModel>, track: Option<Arc<Track>>) -> Self {
        OpenLoop {
            resolver: ForceResolver::new(Arc::clone(&train), track),
            train,
            samples: Vec::with_capacity(SAMPLES_MAX),
            forces: QuadraticForces::default(),
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

    /// Ends the window: the error over its moving samples, none where nothing can be simulated.
    pub fn close(&mut self) -> SpeedError {
        let samples = std::mem::replace(&mut self.samples, Vec::with_capacity(SAMPLES_MAX));
        let Ok(recording) = Recording::new(samples, BridgeLimits::default()) else {
            return SpeedError::default();
        };
        self.forces.set_declared(&recording, self.train.resistance);
        self.prediction.simulate(&recording, &self.forces, Restart::FullRun);
        SpeedError::of(&recording, &self.prediction)
    }
}
