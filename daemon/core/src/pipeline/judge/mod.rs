//! One judge of what an estimate may be used for, whichever estimator it is from.
//!
//! - [`InputHealth`]: whether the samples serve the estimator
//! - [`InnovationMonitor`]: whether the innovations are as large and as white as the covariance says
//! - [`LackOfFit`]: whether a force that no parameter explains stays
//! - [`StatusInputs`]: all that is known of an estimate, and the verdict on it

use dynocar_model::force::ResolvedSample;
use dynocar_shared::{Reason, RejectionReason, Status};

use crate::pipeline::Outcome;

pub use innovations::{
    InnovationMonitor, LONG_RUN_MAX, are_alike, are_too_large, long_run_variance,
};

mod innovations;

/// All that is known of an estimate when it is judged.
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
    /// The status while one of these is lacking.
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

/// Samples over which refusals are counted.
const MEMORY: f64 = 500.0;
/// Share of refused samples above which the input is called bad.
const BAD_SHARE: f64 = 0.3;

/// Returns the reason for a sample that lacks a force or the gradient.
pub fn missing(sample: &ResolvedSample) -> Reason {
    match sample.gradient_permille {
        None => Reason::GradientUnknown,
        Some(_) => Reason::MissingQuantity,
    }
}

/// Which samples were refused lately, and for want of what.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InputHealth {
    refused_share: f64,
    want: Option<Reason>,
    used: u64,
}

impl InputHealth {
    /// A sample was used.
    pub fn accept(&mut self) {
        self.used += 1;
        self.refused_share -= self.refused_share / MEMORY;
    }

    /// A sample was refused.
    pub fn refuse(&mut self, reason: RejectionReason, sample: &ResolvedSample) {
        self.refused_share += (1.0 - self.refused_share) / MEMORY;
        self.want = (reason == RejectionReason::Missing).then(|| missing(sample));
    }

    /// Takes in what became of a sample, and gives it back.
    pub fn note(&mut self, outcome: Outcome, sample: &ResolvedSample) -> Outcome {
        match outcome {
            Outcome::Rejected(reason) => self.refuse(reason, sample),
            Outcome::Used | Outcome::Updated => self.accept(),
        }
        outcome
    }

    /// Takes in what became of a sample that shows nothing, and gives it back: one at a standstill
    /// counts neither way.
    pub fn passed(&mut self, outcome: Outcome, sample: &ResolvedSample) -> Outcome {
        if outcome == Outcome::Used { outcome } else { self.note(outcome, sample) }
    }

    /// Samples used so far.
    pub fn used(&self) -> u64 {
        self.used
    }

    /// Returns the fault of the input, if there is one.
    pub fn input_doubt(&self) -> Option<Reason> {
        let is_starved = self.used == 0 && self.want.is_some();
        (is_starved || self.refused_share > BAD_SHARE)
            .then(|| self.want.unwrap_or(Reason::BadInput))
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

/// A watch on what a slow bias has to take up because no parameter of the model can.
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

    /// True when the model did not fit for a good part of the time.
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
