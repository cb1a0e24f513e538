//! How well the samples serve an estimator.

use dynocar_model::force::ResolvedSample;
use dynocar_shared::{Reason, RejectionReason};

use crate::pipeline::Outcome;

/// Samples over which refusals are counted.
const MEMORY: f64 = 500.0;
/// Share of refused samples above which the input is called bad.
const BAD_SHARE: f64 = 0.3;

/// What a sample that lacks a force or the gradient lacks.
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

    /// What is wrong with the input, if anything.
    pub fn input_doubt(&self) -> Option<Reason> {
        let is_starved = self.used == 0 && self.want.is_some();
        (is_starved || self.refused_share > BAD_SHARE)
            .then(|| self.want.unwrap_or(Reason::BadInput))
    }
}
