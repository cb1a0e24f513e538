//! A Gaussian belief about a state, moved by a linearised model and by measurements of components.

use nalgebra::{SMatrix, SVector};

use super::rank_one::{measured, moved};

/// Why a step of a filter failed; the belief is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FilterError {
    /// The variance of an innovation is not a positive number.
    #[error("expected an innovation variance above 0, got {variance}")]
    InnovationVariance {
        /// The variance.
        variance: f64,
    },
}

/// Mean and covariance of a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussianState<const N: usize> {
    /// Mean.
    pub mean: SVector<f64, N>,
    /// Covariance, symmetric.
    pub covariance: SMatrix<f64, N, N>,
}

/// What the measurement of a component did to a [`GaussianState`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScalarUpdate<const N: usize> {
    /// Measured minus predicted value.
    pub innovation: f64,
    /// Predicted variance of the innovation.
    pub variance: f64,
    /// One over it.
    pub inverse_variance: f64,
    /// The measurement's share of it.
    pub noise_variance: f64,
    /// Gain.
    pub gain: SVector<f64, N>,
    /// The component that was measured.
    pub component: usize,
}

impl<const N: usize> ScalarUpdate<N> {
    /// Innovation over its predicted standard deviation.
    pub fn normalised(&self) -> f64 {
        self.innovation * self.inverse_variance.sqrt()
    }

    /// Logarithm of the predicted density of the measured value.
    pub fn log_likelihood(&self) -> f64 {
        let normalised_square = self.innovation * self.innovation / self.variance;
        -0.5 * (normalised_square + (std::f64::consts::TAU * self.variance).ln())
    }
}

impl<const N: usize> GaussianState<N> {
    /// A belief with independent components of the given standard deviations.
    pub fn independent(mean: SVector<f64, N>, std: SVector<f64, N>) -> Self {
        let variances = std.component_mul(&std);
        GaussianState { mean, covariance: SMatrix::from_diagonal(&variances) }
    }

    /// Moves the belief to a mean computed by the caller, with the Jacobian of that move.
    #[inline]
    pub fn predict(
        &mut self,
        mean: SVector<f64, N>,
        jacobian: &SMatrix<f64, N, N>,
        process_noise: &SMatrix<f64, N, N>,
    ) {
        self.mean = mean;
        self.covariance = moved(jacobian, &self.covariance, process_noise);
    }

    /// Innovation and gain of measuring one component of the state, without applying them.
    ///
    /// # Errors
    ///
    /// When the innovation's variance is not positive and finite.
    #[inline]
    pub fn innovation(
        &self,
        component: usize,
        measured: f64,
        noise_variance: f64,
    ) -> Result<ScalarUpdate<N>, FilterError> {
        let cross = self.covariance.column(component);
        let variance = cross[component] + noise_variance;
        let inverse_variance = 1.0 / variance;
        // Also refuses NaN; infinity by its inverse.
        if !(variance > 0.0 && inverse_variance > 0.0) {
            return Err(FilterError::InnovationVariance { variance });
        }
        let innovation = measured - self.mean[component];
        let gain = cross * inverse_variance;
        Ok(ScalarUpdate { innovation, variance, inverse_variance, noise_variance, gain, component })
    }

    /// Applies a measurement; the covariance stays symmetric and positive.
    #[inline]
    pub fn apply(&mut self, update: &ScalarUpdate<N>) {
        self.mean += update.gain * update.innovation;
        let ScalarUpdate { component, inverse_variance, noise_variance, .. } = *update;
        let spread = self.covariance.column(component).into_owned();
        let mut row = SVector::zeros();
        row[component] = 1.0;
        measured(&mut self.covariance, &row, &spread, inverse_variance, noise_variance);
    }

    /// Standard deviation of one component.
    pub fn std(&self, component: usize) -> f64 {
        self.covariance[(component, component)].max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix2;

    /// Constant speed, position measured; against the batch least-squares solution.
    #[test]
    fn filtering_a_straight_line_equals_batch_least_squares() {
        let measured = [0.1, 1.2, 1.9, 3.2, 3.9, 5.1];
        let prior =
            GaussianState::independent(SVector::from([0.5, 0.8]), SVector::from([2.0, 1.0]));
        let mut belief = prior;
        let jacobian = Matrix2::new(1.0, 1.0, 0.0, 1.0);
        for (k, &value) in measured.iter().enumerate() {
            if k > 0 {
                belief.predict(jacobian * belief.mean, &jacobian, &SMatrix::zeros());
            }
            let update = belief.innovation(0, value, 0.04).unwrap();
            belief.apply(&update);
        }
        let mut information = prior.covariance.try_inverse().unwrap();
        let mut weighted = information * prior.mean;
        for (k, &value) in measured.iter().enumerate() {
            let row = SVector::from([1.0, k as f64]);
            information += row * row.transpose() / 0.04;
            weighted += row * (value / 0.04);
        }
        let covariance = information.try_inverse().unwrap();
        let start = covariance * weighted;
        let end = jacobian.pow(5);
        assert!((belief.mean - end * start).norm() < 1e-12);
        assert!((belief.covariance - end * covariance * end.transpose()).norm() < 1e-12);
    }

    #[test]
    fn a_measurement_without_variance_is_refused() {
        let belief =
            GaussianState::independent(SVector::from([0.0, 0.0]), SVector::from([0.0, 1.0]));
        let refused = belief.innovation(0, 1.0, 0.0);
        assert_eq!(refused, Err(FilterError::InnovationVariance { variance: 0.0 }));
        assert!(belief.innovation(0, 1.0, f64::NAN).is_err());
    }

    #[test]
    fn ten_thousand_precise_measurements_leave_the_covariance_positive() {
        let mut belief =
            GaussianState::independent(SVector::from([0.0, 0.0]), SVector::from([1e4, 1e4]));
        let jacobian = Matrix2::new(1.0, 0.01, 0.0, 1.0);
        for _ in 0..10_000 {
            belief.predict(jacobian * belief.mean, &jacobian, &SMatrix::zeros());
            let update = belief.innovation(0, 0.0, 1e-12).unwrap();
            belief.apply(&update);
            assert!(belief.covariance.cholesky().is_some());
        }
    }
}
