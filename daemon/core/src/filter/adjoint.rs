//! Fixed-interval smoothing by the adjoint of the filter (Bryson and Frazier 1963; for scalar
//! measurements Bierman 1973).
//!
//! The backward pass carries what the later measurements say as a vector: it multiplies and adds,
//! inverts no covariance, and so cannot fail where a prediction is nearly certain. Its means are
//! those of Rauch, Tung and Striebel.

use nalgebra::{SMatrix, SVector};

use super::{Gaussian, Innovation};

/// One step of a forward pass of a Kalman filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForwardStep<const N: usize> {
    /// Belief before the step's measurement.
    pub predicted: Gaussian<N>,
    /// Belief after it.
    pub filtered: Gaussian<N>,
    /// The component that was measured.
    pub component: usize,
    /// What the measurement said.
    pub innovation: Innovation,
    /// Jacobian of the move from the step before to this one.
    pub jacobian: SMatrix<f64, N, N>,
}

impl<const N: usize> ForwardStep<N> {
    /// How far the measurement moved the state, for an innovation of 1.
    #[inline]
    pub fn gain(&self) -> SVector<f64, N> {
        self.predicted.covariance.column(self.component) * self.innovation.inverse_variance
    }
}

/// Writes the mean of every step, given the measurements of all, into `means`, which must be as
/// long.
///
/// # Panics
///
/// When the lengths differ.
///
/// # Real-time
///
/// Bounded work, no allocation.
pub fn smooth_means<const N: usize>(forward: &[ForwardStep<N>], means: &mut [SVector<f64, N>]) {
    assert_eq!(forward.len(), means.len(), "one mean for each forward step");
    // Gradient of the later innovations' cost by the filtered state.
    let mut later = SVector::<f64, N>::zeros();
    for (step, mean) in forward.iter().zip(means).rev() {
        *mean = step.filtered.mean - step.filtered.covariance * later;
        let Innovation { value, inverse_variance, .. } = step.innovation;
        let shift = step.gain().dot(&later) + inverse_variance * value;
        // Chosen, not indexed: the vector stays in registers.
        later =
            SVector::from_fn(|i, _| if i == step.component { later[i] - shift } else { later[i] });
        later = step.jacobian.tr_mul(&later);
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_runs::MovingState;
    use super::*;

    #[test]
    fn smoothed_means_equal_batch_least_squares() {
        let moving = MovingState::new(12);
        let (batch, _) = moving.batch();
        let forward = moving.forward(|_, _| {});
        let mut means = vec![SVector::zeros(); forward.len()];
        smooth_means(&forward, &mut means);
        for (mean, exact) in means.iter().zip(batch) {
            assert!((mean - exact).norm() < 1e-10);
        }
    }

    #[test]
    fn a_state_that_is_known_for_certain_is_no_obstacle() {
        let mut moving = MovingState::new(5);
        moving.prior = Gaussian { mean: moving.prior.mean, covariance: SMatrix::zeros() };
        moving.noise = SMatrix::zeros();
        let forward = moving.forward(|_, _| {});
        let mut means = vec![SVector::zeros(); forward.len()];
        smooth_means(&forward, &mut means);
        assert_eq!(means[0], moving.prior.mean);
    }
}
