//! The interface of every estimator, and an estimator that estimates nothing.

use dynocar_model::force::ResolvedSample;
use dynocar_shared::{ParameterSnapshot, PipelineKind, Reason, RejectionReason, Status};

use super::KeptEstimate;
use super::judge::{InputState, Judgement};

/// Result of an estimator's update with a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The sample carries no information about the parameters: the estimator waits, or the train stands.
    Idle,
    /// The sample was taken into account; the estimate stays as it was.
    Used,
    /// The sample was taken into account and the estimate was updated.
    Updated,
    /// The sample, or the window that it closed, was refused.
    Rejected(RejectionReason),
}

/// Learns parameters of the train from its samples, in order.
///
/// An implementation allocates only while it is built; time comes in with the samples, and any
/// randomness from a seed in its settings.
pub trait Estimator: Send {
    /// Returns the kind of estimator, for the snapshot.
    fn kind(&self) -> PipelineKind;

    /// Returns whether samples pass the force gate, which holds back lone forces, before they are taken into account.
    fn is_gated(&self) -> bool {
        false
    }

    /// Sees every sample before the gate.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing, reads no clock.
    fn observe(&mut self, _sample: &ResolvedSample) {}

    /// Leaves a sample out that the gate refuses; the next one begins anew.
    fn leave_out(&mut self) {}

    /// Takes one sample into account.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing, reads no clock.
    fn update(&mut self, sample: &ResolvedSample) -> Outcome;

    /// Writes the estimate into a snapshot: parameters with values and covariance, excitation,
    /// innovation statistics, unexplained force, speed range; returns its judgement by the state of the input.
    /// Status and reason are written by the admission, counters and times by the pipeline.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing, reads no clock.
    fn write(&self, input: &InputState, snapshot: &mut ParameterSnapshot) -> Judgement;

    /// Takes an estimate kept from earlier as its prior, before the first sample; false when
    /// it has no use for one. The status stays unestimated until samples confirm it.
    fn warm_start(&mut self, _kept: &KeptEstimate) -> bool {
        false
    }
}

/// Counts the samples and leaves the snapshot without parameters.
#[derive(Clone, Copy, Debug, Default)]
pub struct Echo;

impl Estimator for Echo {
    fn kind(&self) -> PipelineKind {
        PipelineKind::Echo
    }

    fn update(&mut self, _sample: &ResolvedSample) -> Outcome {
        Outcome::Used
    }

    fn write(&self, _input: &InputState, _snapshot: &mut ParameterSnapshot) -> Judgement {
        (Status::Unestimated, Reason::None).into()
    }
}
