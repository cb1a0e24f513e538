//! The one judge of an estimate's use, for every estimator.
//!
//! - [`InnovationMonitor`]: whether the innovations are as large and as white as the covariance predicts
//! - [`LackOfFit`]: whether a force that no parameter explains lasts
//! - [`StatusInputs`]: everything known of an estimate, and the verdict on it
//! - [`InputState`], [`Judgement`]: the state of an estimator's input, and the estimator's answer

use dynocar_model::force::ResolvedSample;
use dynocar_shared::{Reason, Status};

/// Everything known of an estimate when it is judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatusInputs {
    /// Fault that takes precedence over any judgement, such as a numerical failure.
    pub fault: Option<(Status, Reason)>,
    /// Recent fault of the samples.
    pub input: Option<Reason>,
    /// True when enough samples were used.
    pub is_ready: bool,
    /// True when the intervals are narrow enough.
    pub is_known: bool,
    /// The status while samples or precision are lacking.
    pub lacking: Status,
    /// Contradiction of a known estimate.
    pub contradiction: Option<Reason>,
    /// Caveat of an estimate that nothing contradicts.
    pub caveat: Reason,
}

impl StatusInputs {
    /// Status and reason.
    pub fn verdict(&self) -> (Status, Reason) {
        let is_there = self.is_ready && self.is_known;
        if let Some(fault) = self.fault {
            fault
        } else if let Some(reason) = self.input {
            (if is_there { Status::Degraded } else { self.lacking }, reason)
        } else if !self.is_ready {
            (self.lacking, Reason::TooFewSamples)
        } else if !self.is_known {
            (self.lacking, Reason::WeakExcitation)
        } else if let Some(reason) = self.contradiction {
            (Status::Degraded, reason)
        } else {
            (Status::Estimated, self.caveat)
        }
    }
}

/// Returns the reason for a sample that lacks a force or the gradient.
pub fn missing(sample: &ResolvedSample) -> Reason {
    match sample.gradient_permille {
        None => Reason::GradientUnknown,
        Some(_) => Reason::MissingQuantity,
    }
}

/// State of the input as an estimator's judgement needs it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InputState {
    /// Samples used so far.
    pub used: u64,
    /// Recent fault of the samples.
    pub doubt: Option<Reason>,
}

/// Judgement of an estimate by its estimator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Judgement {
    /// Status of the estimate.
    pub status: Status,
    /// Reason of the status.
    pub reason: Reason,
    /// Quantities that are known well enough, one bit each; some may be known before the others.
    pub known: u32,
}

impl From<(Status, Reason)> for Judgement {
    /// Everything is known while the status is estimated.
    fn from((status, reason): (Status, Reason)) -> Self {
        let known = if status == Status::Estimated { u32::MAX } else { 0 };
        Judgement { status, reason, known }
    }
}

/// Looks over which the share is remembered.
const LOOKS_MAX: f64 = 300.0;
/// Looks before anything is said.
const LOOKS_MIN: f64 = 30.0;
/// Standard deviations beyond which a force is no chance.
const DEVIATIONS_MIN: f64 = 3.0;
/// Share of the basic resistance from which a force matters.
const SHARE_MIN: f64 = 0.1;
/// Share of the looks with such a force that the model cannot be said to fit with.
const LASTING_MIN: f64 = 0.1;

/// A watch on the force that a slow bias takes up because no parameter of the model can.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LackOfFit {
    looks: f64,
    share: f64,
}

impl LackOfFit {
    /// Takes in a force with its standard deviation and the basic resistance at the same speed,
    /// all in N/kN.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn look(&mut self, force: f64, std: f64, resistance: f64) {
        let is_seen = force.abs() > DEVIATIONS_MIN * std && force.abs() > SHARE_MIN * resistance;
        self.looks = (self.looks + 1.0).min(LOOKS_MAX);
        self.share += (f64::from(is_seen) - self.share) / self.looks;
    }

    /// Returns whether the model did not fit for a good part of the time.
    pub fn is_lasting(&self) -> bool {
        self.looks >= LOOKS_MIN && self.share > LASTING_MIN
    }
}

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

    #[test]
    fn the_verdict_names_what_is_lacking_before_what_contradicts() {
        let good = StatusInputs {
            fault: None,
            input: None,
            is_ready: true,
            is_known: true,
            lacking: Status::Unestimated,
            contradiction: None,
            caveat: Reason::AtBound,
        };
        let contradiction = Some(Reason::InnovationsTooLarge);
        let input = Some(Reason::BadInput);
        let fault = Some((Status::Invalid, Reason::NumericalFailure));
        for (case, expected) in [
            (good, (Status::Estimated, Reason::AtBound)),
            (
                StatusInputs { contradiction, ..good },
                (Status::Degraded, Reason::InnovationsTooLarge),
            ),
            (
                StatusInputs { contradiction, is_known: false, ..good },
                (Status::Unestimated, Reason::WeakExcitation),
            ),
            (
                StatusInputs { is_known: false, is_ready: false, ..good },
                (Status::Unestimated, Reason::TooFewSamples),
            ),
            (StatusInputs { input, contradiction, ..good }, (Status::Degraded, Reason::BadInput)),
            (
                StatusInputs { input, is_known: false, ..good },
                (Status::Unestimated, Reason::BadInput),
            ),
            (StatusInputs { fault, input, ..good }, (Status::Invalid, Reason::NumericalFailure)),
        ] {
            assert_eq!(case.verdict(), expected, "{case:?}");
        }
    }
}

#[cfg(test)]
mod lack_of_fit_tests {
    use super::*;

    #[test]
    fn only_a_force_that_is_sure_and_large_and_lasts_counts() {
        let lasting = |force: f64, std: f64, every: u32| {
            let mut fit = LackOfFit::default();
            for k in 0..600_u32 {
                fit.look(if k.is_multiple_of(every) { force } else { 0.0 }, std, 2.0);
            }
            fit.is_lasting()
        };
        assert!(lasting(1.0, 0.1, 1) && lasting(-1.0, 0.1, 4));
        assert!(!lasting(1.0, 0.5, 1), "may be chance");
        assert!(!lasting(0.1, 0.01, 1), "hardly matters");
        assert!(!lasting(1.0, 0.1, 50), "a moment");
    }

    #[test]
    fn a_fault_that_has_gone_is_forgotten() {
        let mut fit = LackOfFit::default();
        (0..100).for_each(|_| fit.look(1.0, 0.1, 2.0));
        assert!(fit.is_lasting());
        (0..1000).for_each(|_| fit.look(0.0, 0.1, 2.0));
        assert!(!fit.is_lasting());
    }
}

#[cfg(test)]
mod innovations_tests {
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
