//! How an estimator takes what its gate lets pass.

use dynocar_model::force::ResolvedSample;
use dynocar_shared::RejectionReason;

use super::{SampleGate, Verdict};
use crate::pipeline::Outcome;

/// An estimator whose samples pass a gate.
pub trait Gated {
    /// The gate.
    fn gate(&mut self) -> &mut SampleGate;

    /// Takes a sample that has passed.
    fn take(&mut self, sample: &ResolvedSample) -> Outcome;

    /// Leaves a sample out; the next one begins anew.
    fn leave_out(&mut self, sample: &ResolvedSample, reason: RejectionReason);

    /// Judges a sample and takes what the verdict sets free.
    ///
    /// # Real-time
    ///
    /// The work of as many samples as can be held, no allocation.
    fn pass(&mut self, sample: &ResolvedSample) -> Outcome {
        match self.gate().judge(sample) {
            Verdict::Take => self.take(sample),
            Verdict::Wait => Outcome::Used,
            Verdict::Release(count) => {
                (0..count).fold(Outcome::Used, |last, index| match self.gate().released(index) {
                    Some(released) => self.take(&released),
                    None => last,
                })
            }
            Verdict::Refuse(reason) => {
                self.leave_out(sample, reason);
                Outcome::Rejected(reason)
            }
        }
    }
}
