//! How late and how strong brakes are, learned from braking to braking.

use super::motion_filter::{BRAKE_ERROR, STATES, Step};
use crate::filter::Gaussian;

/// Weight that a standard deviation beforehand counts for, and what is looked back over.
const WEIGHT_FIRST: f64 = 2.0;
const WEIGHT_MAX: f64 = 40.0;
/// Greatest square of an error over its variance that counts: a brake that fails is no measure of the others.
const SEEN_MAX: f64 = 30.0;
/// Least standard deviation as a share of the first: brakings differ from each other.
const LEAST_SHARE: f64 = 0.1;

/// Standard deviation of a brake's error, learned by the squares of what is believed of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearnedStd {
    /// The standard deviation.
    pub std: f64,
    least: f64,
    most: f64,
    weight: f64,
}

impl LearnedStd {
    fn new(std: f64, most: f64) -> Self {
        LearnedStd { std, least: LEAST_SHARE * std, most, weight: WEIGHT_FIRST }
    }

    /// Takes in the mean and the variance of an error of variance 1, of which so much is new.
    ///
    /// The mean's square has one less the variance as its expectation, and says the more the smaller that is.
    fn learn(&mut self, (mean, variance): (f64, f64), renewed: f64) {
        let known = (1.0 - variance).max(0.0);
        if known < 1e-3 {
            return;
        }
        let weight = renewed * known * known;
        self.weight = (self.weight + weight).min(WEIGHT_MAX);
        let seen = (mean * mean / known).min(SEEN_MAX);
        let square = self.std * self.std * (1.0 + (seen - 1.0) * weight / self.weight);
        self.std = square.sqrt().clamp(self.least, self.most);
    }
}

/// Learned behaviour of brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrakeErrors {
    /// Of what the slowest brake would lack.
    pub late: LearnedStd,
    /// Of the reported force.
    pub scale: LearnedStd,
}

impl BrakeErrors {
    /// Before any braking, with the standard deviation of the scale.
    pub fn new(scale_std: f64) -> Self {
        BrakeErrors { late: LearnedStd::new(1.0, 2.0), scale: LearnedStd::new(scale_std, 1.0) }
    }

    /// Learns from what is believed after a step.
    ///
    /// # Real-time
    ///
    /// Constant work, no allocation.
    pub fn learn(&mut self, step: &Step, belief: &Gaussian<STATES>) {
        let error = (belief.mean[BRAKE_ERROR], belief.covariance[(BRAKE_ERROR, BRAKE_ERROR)]);
        let renewed = step.brake_error.1;
        if step.brake_std > 0.0 {
            self.late.learn(error, renewed * step.brake_lateness);
            self.scale.learn(error, renewed * (1.0 - step.brake_lateness));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Standard deviation after 200 errors of a size in first standard deviations, each known to a variance of 0.1.
    fn learned(size: f64) -> f64 {
        let mut scale = BrakeErrors::new(0.3).scale;
        for _ in 0..200 {
            scale.learn((size * 0.3 / scale.std * 0.9, 0.1), 1.0);
        }
        scale.std / 0.3
    }

    #[test]
    fn the_standard_deviation_follows_the_errors_within_its_bounds() {
        for size in [0.2, 0.5, 1.0, 2.0] {
            assert!((learned(size) / size - 0.95).abs() < 0.06, "{size}: {}", learned(size));
        }
        assert!((learned(0.0) - LEAST_SHARE).abs() < 1e-9);
        assert!((learned(9.0) - 1.0 / 0.3).abs() < 1e-9, "not above the whole force");
    }

    #[test]
    fn an_error_of_which_nothing_is_known_teaches_nothing() {
        let mut scale = BrakeErrors::new(0.3).scale;
        scale.learn((0.0, 1.0), 1.0);
        assert_eq!(scale, BrakeErrors::new(0.3).scale);
    }
}
