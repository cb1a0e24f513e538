//! The one judge of an estimate's use, for every estimator.
//!
//! - [`InnovationMonitor`]: whether the innovations are as large and as white as the covariance predicts
//! - [`LackOfFit`]: whether a force that no parameter explains lasts
//! - [`StatusInputs`]: everything known of an estimate, and the verdict on it
//! - [`InputState`], [`Judgement`]: the state of an estimator's input, and the estimator's answer

use dynocar_model::force::ResolvedSample;
use dynocar_shared::{Reason, Status};

pub use innovations::{
    InnovationMonitor, LONG_RUN_MAX, are_alike, are_too_large, long_run_variance,
};

mod innovations;

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
