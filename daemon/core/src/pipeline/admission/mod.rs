//! Admission of samples: the only place that judges incoming samples, and the only one that writes a status.
//!
//! A sample is *refused* by validation (it cannot be true), by the force gate (its force is lone, or it only repeats)
//! or by the estimator (it lacks a force, its wheels slide, or it does not fit). The input is *doubted* while wrong
//! units, reversed signs or exchanged forces make the samples impossible together, or too many of them are refused.
//! [`limits`] has the bounds.
//!
//! - `validation`: a sample by itself and after the ones before it
//! - `force_gate`: lone forces, for the estimators that step from sample to sample
//! - [`crate::plausibility`]: units, signs and exchanged forces over many samples

mod force_gate;
pub mod limits;
mod validation;

use std::sync::Arc;

use dynocar_model::force::{ForceResolver, ResolvedSample, ValidSample};
use dynocar_model::train::TrainModel;
use dynocar_shared::{
    ParameterSnapshot, PipelineKind, Reason, RejectionReason, Status, TrainId, TrainSample,
};

use self::force_gate::{ForceGate, GateVerdict};
use self::limits::{INVALID_SHARE, REFUSALS_MEMORY, UNFIT_SHARE};
use self::validation::Validator;
use super::estimator::{Estimator, Outcome};
use super::judge::{InputState, missing};
use crate::plausibility::watch::PlausibilityWatch;
use crate::plausibility::window_balance::WindowMean;
use crate::plausibility::{DetectedFault, DetectedFaults, diagnose};

/// Judges the samples of one train, in order, for one estimator or for a reader of recorded runs.
#[derive(Clone, Debug)]
pub struct Admission {
    validator: Validator,
    watch: PlausibilityWatch,
    detected: DetectedFaults,
    gate: ForceGate,
    /// Shares lately: of all samples, those that validation refused; of those that were to serve, those that did not.
    invalid_share: f64,
    unfit_share: f64,
    /// Quantity that the newest sample that did not serve lacked.
    wanted: Option<Reason>,
    used: u64,
}

impl Admission {
    /// Returns the admission of a train's samples before the first of them.
    pub fn new(train_id: TrainId, train: Arc<TrainModel>) -> Self {
        Admission {
            validator: Validator::new(train_id, train.mass_kg),
            watch: PlausibilityWatch::new(train),
            detected: DetectedFaults::default(),
            gate: ForceGate::default(),
            invalid_share: 0.0,
            unfit_share: 0.0,
            wanted: None,
            used: 0,
        }
    }

    /// Refuses positions of a train of this length in m off a line of this length in m.
    pub fn keep_on_line(&mut self, line_m: f64, train_m: f64) {
        self.validator.keep_on_line(line_m, train_m);
    }

    /// Counts positions as measured or not: those that are integrated from the speed show nothing about it.
    pub fn set_position_measured(&mut self, is_measured: bool) {
        self.watch.is_position_measured = is_measured;
    }

    /// Returns the number of samples that never arrived so far.
    pub fn lost(&self) -> u64 {
        self.validator.lost()
    }

    /// Counts from the sample after this number; to be called before the first sample. Without it
    /// the count begins with the sample of number 1.
    pub fn count_from(&mut self, sequence: u64) {
        self.validator.count_from(sequence);
    }

    /// Counts as lost the samples up to this number that have not come.
    pub fn count_up_to(&mut self, sequence: u64) {
        self.validator.count_up_to(sequence);
    }

    /// Exchanges the counts of samples with the admission of another model of the same train: each goes on where the
    /// other stopped, by its own limits, and begins a new motion segment.
    pub fn exchange_counts(&mut self, other: &mut Admission) {
        self.validator.exchange(&mut other.validator);
    }

    /// Validates a sample alone, for readers that judge no estimate.
    ///
    /// # Errors
    ///
    /// The first reason that applies.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn validate<'a>(
        &mut self,
        sample: &'a TrainSample,
    ) -> Result<ValidSample<'a>, RejectionReason> {
        self.validator.check(sample)
    }

    /// Validates a sample, resolves its forces, judges the input with it and hands it to an estimator.
    ///
    /// Samples refused for a value out of range take part in the judgement: the range itself may be the fault.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation: a few sums at a sample, a solution of five equations at the
    /// end of a window, and the work of [`Self::pass`].
    pub fn take(
        &mut self,
        sample: &TrainSample,
        resolver: &mut ForceResolver,
        estimator: &mut dyn Estimator,
    ) -> Outcome {
        let valid = self.validator.check(sample);
        // A copy says as much of the samples as the one that it copies, and that has been counted.
        if !matches!(valid, Err(RejectionReason::Repeated)) {
            let refused = f64::from(valid.is_err());
            self.invalid_share += (refused - self.invalid_share) / REFUSALS_MEMORY;
        }
        match valid {
            Ok(valid) => {
                let resolved = resolver.resolve(&valid);
                self.watch(sample, true, resolved.gradient_permille);
                self.pass(estimator, &resolved)
            }
            Err(reason) => {
                match is_of_value(reason) {
                    true => self.watch(sample, false, resolver.stated_gradient_permille(sample)),
                    false => self.watch.ended = None,
                }
                Outcome::Rejected(reason)
            }
        }
    }

    fn watch(&mut self, sample: &TrainSample, is_valid: bool, gradient_permille: Option<f64>) {
        if self.watch.take(sample, is_valid, gradient_permille) {
            self.detected = diagnose(&self.watch.figures());
        }
    }

    /// Hands a sample to an estimator, through the gate where it is gated.
    ///
    /// # Real-time
    ///
    /// The work of as many samples as the gate can hold, no allocation.
    pub fn pass(&mut self, estimator: &mut dyn Estimator, sample: &ResolvedSample) -> Outcome {
        estimator.observe(sample);
        if !estimator.is_gated() {
            return self.hand_over(estimator, sample);
        }
        match self.gate.judge(sample) {
            GateVerdict::Take => self.hand_over(estimator, sample),
            GateVerdict::Wait => Outcome::Idle,
            GateVerdict::Release(count) => {
                (0..count).fold(Outcome::Idle, |last, index| match self.gate.released(index) {
                    Some(released) => self.hand_over(estimator, &released),
                    None => last,
                })
            }
            GateVerdict::Refuse(reason) => {
                estimator.leave_out();
                self.note(Outcome::Rejected(reason), sample)
            }
        }
    }

    fn hand_over(&mut self, estimator: &mut dyn Estimator, sample: &ResolvedSample) -> Outcome {
        let outcome = estimator.update(sample);
        self.note(outcome, sample)
    }

    /// Counts the outcome of a sample.
    fn note(&mut self, outcome: Outcome, sample: &ResolvedSample) -> Outcome {
        if outcome != Outcome::Idle {
            let is_refused = matches!(outcome, Outcome::Rejected(_));
            self.unfit_share += (f64::from(is_refused) - self.unfit_share) / REFUSALS_MEMORY;
            self.used += u64::from(!is_refused);
        }
        if let Outcome::Rejected(reason) = outcome {
            self.wanted = (reason == RejectionReason::Missing).then(|| missing(sample));
        }
        outcome
    }

    /// Returns the state of the input for the estimator that the samples were handed to.
    pub fn input(&self) -> InputState {
        let is_starved = self.used == 0 && self.wanted.is_some();
        let is_unfit = is_starved || self.unfit_share > UNFIT_SHARE.high;
        let of_samples = is_unfit.then(|| self.wanted.unwrap_or(Reason::BadInput));
        let of_forces = self.gate.is_in_doubt().then_some(Reason::BadInput);
        InputState { used: self.used, doubt: of_samples.or(of_forces) }
    }

    /// Writes the estimate with its status and reason into a snapshot; returns the quantities that are known well
    /// enough, one bit each, `None` while the input is doubted.
    ///
    /// # Real-time
    ///
    /// Allocates nothing.
    pub fn write(
        &self,
        estimator: &dyn Estimator,
        snapshot: &mut ParameterSnapshot,
    ) -> Option<u32> {
        let mut judgement = estimator.write(&self.input(), snapshot);
        let implausible = self.implausible(estimator.kind()).map(|it| it.fault.reason());
        let is_refusing = self.invalid_share > INVALID_SHARE.high;
        let is_doubted = is_refusing || implausible.is_some();
        let is_estimated = judgement.status == Status::Estimated;
        let is_open = is_estimated || judgement.status == Status::Unestimated;
        let doubt = implausible.or((is_refusing && is_open).then_some(Reason::BadInput));
        judgement.reason = doubt.unwrap_or(judgement.reason);
        if is_doubted && is_estimated {
            judgement.status = Status::Degraded;
        }
        snapshot.status = judgement.status as u32;
        snapshot.reason = judgement.reason as u32;
        (!is_doubted).then_some(judgement.known)
    }

    /// Returns the recent input fault that spoils the estimates of a kind of pipeline.
    pub fn implausible(&self, kind: PipelineKind) -> Option<DetectedFault> {
        self.detected.iter().find(|detected| detected.fault.concerns(kind)).copied()
    }

    /// Returns the recent impossibilities of the samples.
    pub fn detected(&self) -> &DetectedFaults {
        &self.detected
    }

    /// Returns the means of the window of motion that the last sample ended; `None` where it ended none.
    pub fn ended_window(&self) -> Option<&WindowMean> {
        self.watch.ended.as_ref()
    }
}

/// Returns true for the refusal of a value that may be in another unit.
fn is_of_value(reason: RejectionReason) -> bool {
    matches!(
        reason,
        RejectionReason::MassOutOfRange
            | RejectionReason::ForceOutOfRange
            | RejectionReason::SpeedOutOfRange
            | RejectionReason::OutOfRange
            | RejectionReason::PositionJump
            | RejectionReason::TimeJump
    )
}
