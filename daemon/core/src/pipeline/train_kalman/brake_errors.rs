//! How late and how strong brakes are, learned from braking to braking.
//!
//! A lagging brake lags at every stop. If its lateness were taken to have mean zero, each of a hundred departures would
//! push the resistance at low speed the same way, by less than its standard deviation, and all of them together by far
//! more.

use super::motion_filter::{BRAKE_ERROR, FilterStep, Following, STATES};
use crate::filter::Gaussian;

/// Weight that a standard deviation beforehand counts for, and the weight of the memory.
const WEIGHT_FIRST: f64 = 2.0;
const WEIGHT_MAX: f64 = 40.0;
/// Greatest square of an error over its variance that counts: a brake that fails is no measure of the others.
const SEEN_MAX: f64 = 30.0;
/// Least standard deviation as a share of the first: brakings differ from each other.
const LEAST_SHARE: f64 = 0.1;

/// Standard deviation of a brake's error, learned from the squares of the estimated error.
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
    /// The square of the mean has the expectation 1 - variance, and is the more informative the smaller the variance.
    /// Returns the weight of this step as a share of the weight of the memory.
    fn learn(&mut self, (mean, variance): (f64, f64), renewed: f64) -> f64 {
        let known = (1.0 - variance).max(0.0);
        if known < 1e-3 {
            return 0.0;
        }
        let weight = renewed * known * known;
        self.weight = (self.weight + weight).min(WEIGHT_MAX);
        let seen = (mean * mean / known).min(SEEN_MAX);
        let square = self.std * self.std * (1.0 + (seen - 1.0) * weight / self.weight);
        self.std = square.sqrt().clamp(self.least, self.most);
        weight / self.weight
    }
}

/// How late a brake is, as a share of the impulse that the slowest brake would lack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lateness {
    /// The mean: the same at every stop, an error that no standard deviation stands for.
    pub mean: f64,
    /// Its difference from braking to braking.
    pub spread: LearnedStd,
}

impl Lateness {
    /// Takes in the brake's error over its standard deviation, in the direction of a late one.
    ///
    /// No brake acts before its report.
    fn learn(&mut self, (mean, variance): (f64, f64), renewed: f64) {
        let std = self.spread.std;
        let share = self.spread.learn((mean, variance), renewed);
        if share > 0.0 {
            let seen = mean / (1.0 - variance);
            let most = SEEN_MAX.sqrt();
            self.mean += share * std * seen.clamp(-most, most);
            self.mean = self.mean.clamp(0.0, self.spread.most);
        }
    }
}

/// Learned behaviour of brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrakeErrors {
    /// By [`Following`].
    late: [Lateness; 4],
    /// Of the reported force.
    pub scale: LearnedStd,
}

impl BrakeErrors {
    /// Before any braking, with the standard deviation of the scale.
    pub fn new(scale_std: f64) -> Self {
        let late = Lateness { mean: 0.0, spread: LearnedStd::new(1.0, 2.0) };
        BrakeErrors { late: [late; 4], scale: LearnedStd::new(scale_std, 1.0) }
    }

    /// Returns how late it is.
    pub fn late(&self, following: Following) -> &Lateness {
        &self.late[following as usize]
    }

    /// Learns from the estimate after a step.
    ///
    /// # Real-time
    ///
    /// Constant work, no allocation.
    pub fn learn(&mut self, step: &FilterStep, belief: &Gaussian<STATES>) {
        let error = (belief.mean[BRAKE_ERROR], belief.covariance[(BRAKE_ERROR, BRAKE_ERROR)]);
        let renewed = step.brake_error.1;
        if step.brake_std > 0.0 {
            // A late brake lacks force while it builds up, and has too much while it is released.
            let sign = if step.following == Following::Building { -1.0 } else { 1.0 };
            let late = (sign * error.0, error.1);
            self.late[step.following as usize].learn(late, renewed * step.brake_lateness);
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

    /// Lateness after 200 brakings of a lateness, each known to a variance of 0.1.
    fn late(lateness: f64) -> Lateness {
        let mut late = *BrakeErrors::new(0.3).late(Following::Starting);
        for _ in 0..200 {
            let error = (lateness - late.mean) / late.spread.std;
            late.learn((0.9 * error, 0.1), 1.0);
        }
        late
    }

    #[test]
    fn what_every_braking_lacks_becomes_the_mean_and_no_spread() {
        for lateness in [0.0, 0.3, 1.0] {
            let late = late(lateness);
            assert!((late.mean - lateness).abs() < 0.02, "{lateness}: {late:?}");
            assert!(late.spread.std < 0.2, "{lateness}: {late:?}");
        }
        assert_eq!(late(-0.5).mean, 0.0, "a brake does not act before its report");
    }

    #[test]
    fn an_error_of_which_nothing_is_known_teaches_nothing() {
        let mut scale = BrakeErrors::new(0.3).scale;
        scale.learn((0.0, 1.0), 1.0);
        assert_eq!(scale, BrakeErrors::new(0.3).scale);
    }
}
