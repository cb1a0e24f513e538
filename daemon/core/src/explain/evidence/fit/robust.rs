//! Huber's loss, and the innovations of a run under it.

use nalgebra::Vector3;

use super::super::noise::Whitener;
use super::super::run_scatter::{ScatterFilter, WeightedFilter};

/// Innovations beyond this many standard deviations count linearly (Huber).
const HUBER: f64 = 3.0;

/// Huber's loss, twice: the square within the bound.
#[inline]
pub(in super::super) fn robust_loss(nu: f64) -> f64 {
    let size = nu.abs();
    if size <= HUBER { nu * nu } else { HUBER * (2.0 * size - HUBER) }
}

/// Weight of an innovation in a normal equation.
#[inline]
fn robust_weight(nu: f64) -> f64 {
    let size = nu.abs();
    if size <= HUBER { 1.0 } else { HUBER / size }
}

/// The filters of one run under a noise.
#[derive(Clone)]
pub(super) struct RunFilters {
    pub whitener: Whitener,
    pub scatter: ScatterFilter,
}

/// Innovations of one run and what follows from them.
pub(super) struct Whitened {
    pub innovations: Vec<f64>,
    pub filter: WeightedFilter,
    pub factors: Vector3<f64>,
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
