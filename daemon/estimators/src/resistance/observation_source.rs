//! Sources of the observations of the regression.

use dynocar_core::pipeline::momentum::blocks::MomentumBlocks;
use dynocar_core::pipeline::momentum::{DataSettings, DataSource, SinceBlock, UnitSample};
use dynocar_core::pipeline::motion::SpeedNoise;
use dynocar_model::train::Davis;
use dynocar_shared::RejectionReason;

use super::regression::RegressionObservation;
use crate::liu::CoastingSegments;

#[derive(Clone, Debug)]
enum Builder {
    Momentum(Box<MomentumBlocks>),
    Coasting(Box<CoastingSegments>),
}

/// Turns samples into observations, of the kind that the settings ask for.
#[derive(Clone, Debug)]
pub struct RowSource {
    builder: Builder,
    speed_min_mps: f64,
}

impl RowSource {
    /// Returns a source without samples.
    pub fn new(settings: DataSettings) -> Self {
        let builder = match settings.source {
            DataSource::Momentum => Builder::Momentum(Box::new(MomentumBlocks::new(settings))),
            DataSource::Coasting => Builder::Coasting(Box::new(CoastingSegments::new(settings))),
        };
        RowSource { builder, speed_min_mps: settings.speed_min_mps }
    }

    /// Takes in a sample; gives the observation that it closes, with its mean speed in m/s.
    /// `known` is the resistance as far as it is known.
    ///
    /// # Errors
    ///
    /// [`RejectionReason::Outlier`] for a spike of the speed.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn push(
        &mut self,
        now: &UnitSample,
        known: &Davis,
    ) -> Result<Option<(RegressionObservation, f64)>, RejectionReason> {
        if now.speed_mps < self.speed_min_mps {
            // A holding brake may be reported, and static friction is no Davis resistance.
            self.break_chain();
            return Ok(None);
        }
        Ok(match &mut self.builder {
            Builder::Momentum(blocks) => blocks
                .push(now, known)?
                .map(|block| (RegressionObservation::Block(block), block.speed_mps)),
            Builder::Coasting(segments) => segments
                .push(now, known)?
                .map(|segment| (RegressionObservation::Segment(segment), segment.speed_mps)),
        })
    }

    /// Returns the integrals since the middle of the newest block; `None` before the first of a chain, and of
    /// coasting segments, which have no level of momentum.
    pub fn since_block(&self) -> Option<SinceBlock> {
        match &self.builder {
            Builder::Momentum(blocks) => blocks.since_block(),
            Builder::Coasting(_) => None,
        }
    }

    /// Ends the chain: the next sample starts a new one.
    pub fn break_chain(&mut self) {
        match &mut self.builder {
            Builder::Momentum(blocks) => blocks.break_chain(),
            Builder::Coasting(segments) => segments.break_chain(),
        }
    }

    /// Returns the noise of the speed so far.
    pub fn noise(&self) -> &SpeedNoise {
        match &self.builder {
            Builder::Momentum(blocks) => blocks.noise(),
            Builder::Coasting(segments) => segments.noise(),
        }
    }
}
