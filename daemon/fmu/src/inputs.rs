//! Inputs during a step: their values at its beginning, and their slopes where they are given.

use dynocar_shared::{SampleField, TrainSample};

use crate::files::TRAIN;
use crate::variables::MISSING;

/// The inputs of an instance.
#[derive(Clone, Copy, Debug)]
pub struct Inputs {
    /// The inputs as they were set; the sample's number is that of the newest step.
    pub sample: TrainSample,
    /// Slopes by [`SampleField`], in the input's unit per s.
    slopes: [f64; SampleField::ALL.len()],
}

impl Default for Inputs {
    fn default() -> Self {
        let sample = TrainSample { run: 1, ..TrainSample::empty(TRAIN) };
        Inputs { sample, slopes: [0.0; SampleField::ALL.len()] }
    }
}

impl Inputs {
    /// Sets a measured input; [`MISSING`] and NaN mean that it was not measured.
    pub fn set(&mut self, field: SampleField, value: f64) {
        if value.is_nan() || value == MISSING {
            self.sample.valid &= !field.bit();
        } else {
            self.sample.set(field, value);
        }
    }

    /// Returns the value of a field.
    pub fn get(&self, field: SampleField) -> f64 {
        self.sample.get(field).unwrap_or(MISSING)
    }

    /// Sets a slope for one step; a simulator that interpolates towards a missing value gives a slope that is no
    /// number.
    pub fn set_slope(&mut self, field: SampleField, per_s: f64) {
        self.slopes[field as usize] = if per_s.is_finite() { per_s } else { 0.0 };
    }

    /// Forgets the slopes: each holds for one step.
    pub fn end_step(&mut self) {
        self.slopes.fill(0.0);
    }

    /// Returns the sample that acts `after_s` seconds after a time in s.
    #[inline]
    pub fn at(&self, time_s: f64, after_s: f64) -> TrainSample {
        let mut sample = self.sample;
        sample.time_ns = nanoseconds(time_s + after_s);
        for field in SampleField::ALL {
            if let Some(value) = sample.get(field) {
                sample.set(field, value + self.slopes[field as usize] * after_s);
            }
        }
        sample
    }
}

/// As the reader of recorded runs makes a time of a cell.
pub fn nanoseconds(time_s: f64) -> i64 {
    (time_s * 1e9).round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_holds_for_one_step_and_what_is_missing_stays_missing() {
        let mut inputs = Inputs::default();
        inputs.set(SampleField::TractionForce, 1e3);
        inputs.set_slope(SampleField::TractionForce, 200.0);
        inputs.set_slope(SampleField::BrakeForce, 5.0);
        let later = inputs.at(3.0, 0.5);
        assert_eq!((later.time_ns, later.traction_force_n), (3_500_000_000, 1100.0));
        assert_eq!(later.get(SampleField::BrakeForce), None);
        inputs.set_slope(SampleField::TractionForce, f64::NAN);
        assert_eq!(inputs.at(3.0, 0.5).traction_force_n, 1e3, "no number is no slope");
        inputs.set_slope(SampleField::TractionForce, 200.0);
        inputs.end_step();
        assert_eq!(inputs.at(3.0, 0.5).traction_force_n, 1e3);
        inputs.set(SampleField::TractionForce, f64::NAN);
        assert_eq!(inputs.get(SampleField::TractionForce), MISSING);
    }
}
