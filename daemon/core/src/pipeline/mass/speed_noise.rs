//! The noise of the measured speed, learned from what filters leave of it.

use crate::pipeline::motion::Rounding;

/// Innovations over which the noise is learned.
const MEMORY: f64 = 3000.0;
/// Innovations that the noise of the settings counts for.
const PRIOR_COUNT: f64 = 2.0;
/// Least variance in (m/s)².
const VARIANCE_MIN: f64 = 1e-6;

/// Variance of the measured speed.
///
/// After an update, the residual r and the variance P of the filtered speed obey E[r²] + P = R
/// for the variance R of the measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedNoise {
    initial: f64,
    variance: f64,
    count: f64,
    /// The steps of the signal.
    pub rounding: Rounding,
}

impl SpeedNoise {
    /// Starts at a standard deviation in m/s.
    pub fn new(std_mps: f64) -> Self {
        let initial = std_mps * std_mps;
        SpeedNoise { initial, variance: initial, count: PRIOR_COUNT, rounding: Rounding::default() }
    }

    /// The variance in (m/s)².
    pub fn variance(&self) -> f64 {
        self.variance
    }

    /// Variance in (m/s)² such that one may treat a sample as independent of its neighbours;
    /// `per_step_mps` is how far the speed moves from one sample to the next.
    pub fn variance_of_sample(&self, per_step_mps: f64) -> f64 {
        self.rounding.variance_of_sample(self.variance, per_step_mps)
    }

    /// Takes in a residual in m/s, the variance of the filtered speed, and the weight that the
    /// measurement had against a full one.
    pub fn learn(&mut self, residual_mps: f64, filtered_variance: f64, weight: f64) {
        let seen = weight * residual_mps * residual_mps + filtered_variance;
        self.count = (self.count + 1.0).min(MEMORY);
        self.variance = (self.variance + (seen - self.variance) / self.count).max(VARIANCE_MIN);
    }

    /// Back to the start.
    pub fn reset(&mut self) {
        *self = SpeedNoise { variance: self.initial, count: PRIOR_COUNT, ..*self };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn a_filter_of_a_constant_finds_the_noise_of_its_measurements() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut noise = SpeedNoise::new(0.2);
        let (mut estimate, mut variance) = (0.0, 1.0);
        for _ in 0..5_000 {
            // Uniform between -1 and 1: variance 1/3.
            let measured = 2.0 * random.random::<f64>() - 1.0;
            let gain = variance / (variance + noise.variance());
            estimate += gain * (measured - estimate);
            variance *= 1.0 - gain;
            noise.learn(measured - estimate, variance, 1.0);
            variance += 1e-3;
        }
        assert!((noise.variance() - 1.0 / 3.0).abs() < 0.05, "{}", noise.variance());
    }
}
