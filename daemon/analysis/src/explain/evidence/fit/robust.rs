//! The innovations of a run under Huber's loss.

use std::sync::Arc;

use super::super::run_scatter::{RunFactors, ScatterFilter, WeightedFilter};
use super::super::whitener::{Whitener, robust_weight};

/// The filters of one run under a noise.
#[derive(Clone)]
pub(super) struct RunFilters {
    pub whitener: Whitener,
    pub scatter: ScatterFilter,
}

/// Those of all runs.
pub(super) type SharedFilters = Arc<[RunFilters]>;

/// Innovations of one run and what follows from them.
pub(super) struct Whitened {
    pub innovations: Vec<f64>,
    pub filter: WeightedFilter,
    pub factors: RunFactors,
    pub cost: f64,
}

impl RunFilters {
    /// Robust innovations of a series of bin differences.
    pub fn whitened(&self, residual: &[f64], scratch: &mut Vec<f64>) -> Whitened {
        self.whitener.whiten(residual, scratch);
        let weights = |series: &[f64]| series.iter().map(|&nu| robust_weight(nu)).collect();
        let rough = self.scatter.weighted(weights(scratch));
        let less = rough.remove(scratch, &rough.factors(scratch));
        let filter = self.scatter.weighted(weights(&less));
        let factors = filter.factors(scratch);
        let innovations = filter.remove(scratch, &factors);
        let cost = self.whitener.minus_two_log_likelihood(&innovations)
            + self.scatter.prior_cost(&factors)
            + filter.log_determinant;
        Whitened { innovations, filter, factors, cost }
    }
}
