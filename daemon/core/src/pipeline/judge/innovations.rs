//! Consistency of an estimator's innovations with its covariance.

use dynocar_shared::Reason;

/// Mean square of normalised innovations above which they are too large.
const MEAN_SQUARE_MAX: f64 = 2.0;
/// Lag-1 covariance of the normalised innovations above which the model lacks something. It is the covariance and not
/// the correlation, since correlation does not matter where the innovations are far smaller than expected, as with a
/// perfect sensor.
const COVARIANCE_MAX: f64 = 0.4;
/// Long-run variance of the normalised innovations above which the intervals are too narrow, even if every innovation
/// is small: noise that was learned from bad speeds makes the innovations small but leaves them correlated.
pub const LONG_RUN_MAX: f64 = 4.0;
/// Number of standard deviations by which a statistic must exceed the mean that it has for white innovations, before
/// the excess is more than chance.
const CHANCE_DEVIATIONS: f64 = 4.0;

/// Returns whether a mean square says that innovations are larger than the covariance predicts.
pub fn are_too_large(mean_square: f64) -> bool {
    mean_square > MEAN_SQUARE_MAX
}

/// Returns whether mean square and lag-1 correlation say that successive innovations are alike: by their covariance, or
/// by the variance of their sums over that of as many white innovations of the expected size, if the correlation fades
/// from lag to lag as it does over the first.
pub fn are_alike(mean_square: f64, correlation: f64) -> bool {
    correlation * mean_square > COVARIANCE_MAX
        || long_run_variance(mean_square, correlation) > LONG_RUN_MAX
}

/// Returns the variance of sums of innovations over that of as many white ones of the expected size, if their
/// correlation fades from lag to lag as it does over the first.
pub fn long_run_variance(mean_square: f64, correlation: f64) -> f64 {
    mean_square * (1.0 + correlation) / (1.0 - correlation).max(f64::EPSILON)
}

/// Exponentially forgotten mean square and lag-1 correlation of normalised innovations.
///
/// A consistent estimator has mean square 1 and correlation 0 (Bar-Shalom, Li, Kirubarajan
/// 2001, section 5.4: NIS and whiteness tests).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InnovationMonitor {
    forgetting: f64,
    weight: f64,
    mean_square: f64,
    product_weight: f64,
    mean_product: f64,
    last: f64,
}

impl InnovationMonitor {
    /// Returns a monitor that looks back over about `memory` innovations.
    pub fn new(memory: u32) -> Self {
        InnovationMonitor {
            forgetting: 1.0 - 1.0 / f64::from(memory.max(2)),
            weight: 0.0,
            mean_square: 0.0,
            product_weight: 0.0,
            mean_product: 0.0,
            last: 0.0,
        }
    }

    /// Takes in an innovation divided by its predicted standard deviation.
    pub fn push(&mut self, normalised: f64) {
        if self.weight > 0.0 {
            average(
                &mut self.mean_product,
                &mut self.product_weight,
                self.forgetting,
                normalised * self.last,
            );
        }
        let square = normalised * normalised;
        average(&mut self.mean_square, &mut self.weight, self.forgetting, square);
        self.last = normalised;
    }

    /// Forgets the last innovation, so that no correlation is formed across a gap.
    pub fn break_here(&mut self) {
        self.last = 0.0;
    }

    /// Returns the newest normalised innovation.
    pub fn last(&self) -> f64 {
        self.last
    }

    /// Returns the mean square of the normalised innovations; 0 before the first.
    pub fn mean_square(&self) -> f64 {
        self.mean_square
    }

    /// Lag-1 correlation, -1 to 1; 0 before the second innovation.
    pub fn correlation(&self) -> f64 {
        if self.mean_square > 0.0 {
            (self.mean_product / self.mean_square).clamp(-1.0, 1.0)
        } else {
            0.0
        }
    }

    /// Returns the number of innovations that the averages rest on.
    pub fn effective_count(&self) -> f64 {
        self.weight
    }

    /// Returns whether they are larger than the covariance says, and by more than chance.
    pub fn are_too_large(&self) -> bool {
        let chance = CHANCE_DEVIATIONS * (2.0 / self.weight).sqrt();
        are_too_large(self.mean_square) && self.mean_square > 1.0 + chance
    }

    /// Returns the contradiction of the model by the innovations, if there is one.
    pub fn contradiction(&self) -> Option<Reason> {
        let is_no_chance = self.correlation() * self.weight.sqrt() > CHANCE_DEVIATIONS;
        if self.are_too_large() {
            Some(Reason::InnovationsTooLarge)
        } else if is_no_chance && are_alike(self.mean_square, self.correlation()) {
            Some(Reason::InnovationsNotWhite)
        } else {
            None
        }
    }
}

fn average(mean: &mut f64, weight: &mut f64, forgetting: f64, value: f64) {
    *weight = *weight * forgetting + 1.0;
    *mean += (value - *mean) / *weight;
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn white_innovations_of_unit_variance_read_one_and_zero() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut monitor = InnovationMonitor::new(5_000);
        for _ in 0..20_000 {
            // Sum of twelve uniforms: variance 1.
            let sum: f64 = (0..12).map(|_| random.random::<f64>()).sum();
            monitor.push(sum - 6.0);
        }
        assert!((monitor.mean_square() - 1.0).abs() < 0.06);
        assert!(monitor.correlation().abs() < 0.05);
    }

    #[test]
    fn a_constant_innovation_is_fully_correlated() {
        let mut monitor = InnovationMonitor::new(100);
        for _ in 0..50 {
            monitor.push(0.5);
        }
        assert!((monitor.correlation() - 1.0).abs() < 1e-12);
        assert!((monitor.mean_square() - 0.25).abs() < 1e-12);
    }

    fn monitor(innovation: impl Fn(u32) -> f64) -> InnovationMonitor {
        let mut monitor = InnovationMonitor::new(500);
        (0..1_000).for_each(|k| monitor.push(innovation(k)));
        monitor
    }

    #[test]
    fn innovations_are_judged_by_size_and_by_likeness() {
        let sign = |k: u32| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let slow = |k: u32| if (k / 20).is_multiple_of(2) { 1.0 } else { -1.0 };
        assert_eq!(InnovationMonitor::new(500).contradiction(), None, "none yet");
        assert_eq!(monitor(sign).contradiction(), None);
        let large = monitor(|k| 2.0 * sign(k)).contradiction();
        assert_eq!(large, Some(Reason::InnovationsTooLarge));
        assert_eq!(monitor(slow).contradiction(), Some(Reason::InnovationsNotWhite));
        assert_eq!(monitor(|k| 0.3 * slow(k)).contradiction(), None, "small");
    }

    #[test]
    fn a_few_innovations_contradict_only_by_more_than_chance() {
        let after = |count: u32, innovation: f64| {
            let mut monitor = InnovationMonitor::new(500);
            (0..count)
                .for_each(|k| monitor.push(if k % 2 == 0 { innovation } else { -innovation }));
            monitor.contradiction()
        };
        assert_eq!(after(20, 1.5), None);
        assert_eq!(after(60, 1.5), Some(Reason::InnovationsTooLarge));
        assert_eq!(after(6, 4.0), Some(Reason::InnovationsTooLarge));
    }
}
