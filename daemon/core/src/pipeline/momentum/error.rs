//! The error of momentum rows: what a small unknown force leaves of one block's momentum in the next.

use nalgebra::{SMatrix, SVector, Vector2};

use crate::filter::{Propagation, Sighting};

/// Hidden states of the error: accumulated momentum (or what the overlap brings over), and the
/// disturbance.
pub const STATES: usize = 2;
/// Index of the accumulated momentum.
pub const MOMENTUM: usize = 0;
/// Index of the disturbance.
pub const DISTURBANCE: usize = 1;

/// A slow force that the model does not know: an Ornstein-Uhlenbeck process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbance {
    /// Standard deviation in N/kN.
    pub std_n_per_kn: f64,
    /// Correlation time in s.
    pub time_s: f64,
}

impl Disturbance {
    /// It goes on for a time, and nothing else.
    pub fn decay<const C: usize>(&self, duration_s: f64) -> Propagation<STATES, C> {
        let mut step = Propagation {
            transition: SMatrix::<f64, STATES, STATES>::zeros(),
            input: SMatrix::zeros(),
            noise: SMatrix::zeros(),
        };
        let kept = (-duration_s / self.time_s).exp();
        step.transition[(DISTURBANCE, DISTURBANCE)] = kept;
        step.noise[(DISTURBANCE, DISTURBANCE)] = self.std_n_per_kn.powi(2) * (1.0 - kept * kept);
        step
    }

    /// Over a gap, unknown for how long when `None`, to the first block of a chain: its momentum and
    /// the variance of that are new. The block is used up by it.
    pub fn across_gap<const C: usize>(
        &self,
        gap_s: Option<f64>,
        momentum: f64,
        variance: f64,
    ) -> Propagation<STATES, C> {
        let mut step = self.decay(gap_s.unwrap_or(f64::INFINITY));
        step.input[(MOMENTUM, 0)] = momentum;
        step.noise[(MOMENTUM, MOMENTUM)] = variance;
        step
    }

    /// From a block to the next, by the columns of the impulse between them, which took `duration_s`.
    pub fn over_impulse<const C: usize>(
        &self,
        duration_s: f64,
        impulse: &SVector<f64, C>,
        variance: f64,
    ) -> Propagation<STATES, C> {
        let mut step: Propagation<STATES, C> = self.decay(duration_s);
        step.transition[(MOMENTUM, MOMENTUM)] = 1.0;
        step.transition[(MOMENTUM, DISTURBANCE)] = -duration_s;
        step.input.set_row(MOMENTUM, &impulse.transpose());
        step.noise[(MOMENTUM, MOMENTUM)] = variance;
        step
    }
}

/// A block's momentum, seen with the variance that the speed's noise gives it.
pub fn momentum_seen<const C: usize>(momentum: f64, variance: f64) -> Sighting<STATES, C> {
    let mut observed = SVector::zeros();
    observed[0] = momentum;
    Sighting { direction: Vector2::new(1.0, 0.0), observed, variance }
}
