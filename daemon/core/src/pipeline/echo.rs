//! An estimator that estimates nothing: the floor that latency is compared with.

use dynocar_model::force::ResolvedSample;
use dynocar_shared::{ParameterSnapshot, PipelineKind, Reason, Status};

use super::{Estimator, Outcome};

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
