//! The interface of every estimator, and one that estimates nothing.

use dynocar_model::force::ResolvedSample;
use dynocar_shared::{ParameterSnapshot, PipelineKind, Reason, RejectionReason, Status};

use super::KeptEstimate;

/// Result of an estimator's update with a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
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
    /// The kind of estimator, for the snapshot.
    fn kind(&self) -> PipelineKind;

    /// Takes one sample into account.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing, reads no clock.
    fn update(&mut self, sample: &ResolvedSample) -> Outcome;

    /// Writes the estimate into a snapshot: status and reason, parameters with values and
    /// covariance, excitation, innovation statistics, unexplained force, speed range. The
    /// counters and times are the pipeline's.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing, reads no clock.
    fn write(&self, snapshot: &mut ParameterSnapshot);

    /// Of the quantities that it answers, one bit for each that is known well enough under its status:
    /// all of them while that is estimated. One may be known before the others are.
    fn known(&self, status: Status) -> u32 {
        if status == Status::Estimated { u32::MAX } else { 0 }
    }

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

    fn write(&self, snapshot: &mut ParameterSnapshot) {
        snapshot.status = Status::Unestimated as u32;
        snapshot.reason = Reason::None as u32;
    }
}
