//! The error of a predicted speed.

use std::ops::Range;

use super::prediction::Prediction;
use super::recording::Recording;

/// Samples at or below this measured speed in m/s do not count.
pub const MOVING_SPEED_MPS: f64 = 0.5;

/// Sum of squared differences between predicted and measured speed over moving samples; pooled
/// over runs by addition.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedError {
    /// Sum of squares in (m/s)².
    pub sum_of_squares: f64,
    /// Moving samples.
    pub count: usize,
}

impl SpeedError {
    /// The error of a prediction over the run's moving, simulated samples.
    ///
    /// # Panics
    ///
    /// When the prediction belongs to another run.
    pub fn of(recording: &Recording, prediction: &Prediction) -> Self {
        SpeedError::within(recording, prediction, 0..recording.samples().len())
    }

    /// The same over some samples of the run.
    ///
    /// # Panics
    ///
    /// When the prediction belongs to another run, or the run has not these samples.
    pub fn within(recording: &Recording, prediction: &Prediction, samples: Range<usize>) -> Self {
        assert_eq!(recording.samples().len(), prediction.speed_mps().len());
        let mut error = SpeedError::default();
        for i in samples {
            let measured_mps = recording.speed_mps()[i];
            if measured_mps > MOVING_SPEED_MPS && recording.is_simulated(i) {
                let difference = prediction.speed_mps()[i] - measured_mps;
                error.sum_of_squares += difference * difference;
                error.count += 1;
            }
        }
        error
    }

    /// Root mean square in m/s; `None` without moving samples.
    pub fn rmse_mps(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.sum_of_squares / self.count as f64).sqrt())
    }
}

impl core::ops::Add for SpeedError {
    type Output = SpeedError;

    fn add(self, other: SpeedError) -> SpeedError {
        SpeedError {
            sum_of_squares: self.sum_of_squares + other.sum_of_squares,
            count: self.count + other.count,
        }
    }
}

impl core::iter::Sum for SpeedError {
    fn sum<I: Iterator<Item = SpeedError>>(errors: I) -> SpeedError {
        errors.fold(SpeedError::default(), |sum, error| sum + error)
    }
}
