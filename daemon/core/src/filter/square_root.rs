//! A covariance as its lower triangular factor L, P = L Lᵀ.
//!
//! The factor keeps P symmetric and positive even if its entries differ by many orders of magnitude (Bierman 1977,
//! Factorization Methods for Discrete Sequential Estimation; Carlson 1973 for the update).

use nalgebra::{SMatrix, SVector};

/// Lower triangular factor of a covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CovarianceFactor<const N: usize>(pub SMatrix<f64, N, N>);

impl<const N: usize> CovarianceFactor<N> {
    /// Uncorrelated states of given standard deviations.
    pub fn diagonal(deviations: &SVector<f64, N>) -> Self {
        CovarianceFactor(SMatrix::from_diagonal(deviations))
    }

    /// Returns the factor of a covariance; `None` when it is not positive definite.
    pub fn from_covariance(covariance: &SMatrix<f64, N, N>) -> Option<Self> {
        Some(CovarianceFactor(covariance.cholesky()?.unpack()))
    }

    /// P = L Lᵀ.
    pub fn covariance(&self) -> SMatrix<f64, N, N> {
        self.0 * self.0.transpose()
    }

    /// Updates the covariance by a measurement of the last component with noise of variance r > 0,
    /// and gives the gain: how far the state moves for an innovation of 1.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    #[inline]
    pub fn measure_last(&mut self, noise_variance: f64) -> SVector<f64, N> {
        let along = self.0.row(N - 1).transpose();
        self.measure_along(&along, noise_variance)
    }

    /// Returns the update for w = Lᵀ h.
    ///
    /// Only sums of positive terms are formed: with S_k = r + Σ_{j>=k} w_j², the factor of
    /// I - w wᵀ / S_1 has the diagonal √(S_{k+1} / S_k) and, below it, -w_j w_k / √(S_k S_{k+1}).
    #[inline]
    fn measure_along(&mut self, along: &SVector<f64, N>, noise_variance: f64) -> SVector<f64, N> {
        let lower = &mut self.0;
        // From the last column to the first; `carried` is Σ_{j>k} L_ij w_j.
        let mut carried = SVector::<f64, N>::zeros();
        let mut sum = noise_variance;
        let mut root = sum.sqrt();
        for k in (0..N).rev() {
            let weight = along[k];
            let next_sum = sum + weight * weight;
            let next_root = next_sum.sqrt();
            let inverse = 1.0 / (root * next_root);
            let shrink = sum * inverse;
            let shift = weight * inverse;
            for i in k..N {
                let entry = lower[(i, k)];
                lower[(i, k)] = shrink * entry - shift * carried[i];
                carried[i] += entry * weight;
            }
            (sum, root) = (next_sum, next_root);
        }
        carried * (1.0 / sum)
    }

    /// Returns whether every entry is a number and no variance is zero.
    #[inline]
    pub fn is_sound(&self) -> bool {
        // One infinity or NaN makes the sum one.
        self.0.column_sum().sum().is_finite() && (0..N).all(|i| self.0[(i, i)] != 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    fn example() -> Matrix3<f64> {
        Matrix3::new(4.0, 1.0, -0.5, 1.0, 3.0, 0.7, -0.5, 0.7, 2.0)
    }

    #[test]
    fn an_update_is_the_kalman_filters() {
        let prior = example();
        let noise = 0.5;
        let mut factor = CovarianceFactor::from_covariance(&prior).unwrap();
        let found = factor.measure_last(noise);
        let variance = prior[(2, 2)] + noise;
        let gain = prior.column(2) / variance;
        let posterior = prior - gain * gain.transpose() * variance;
        assert!((found - gain).norm() < 1e-12);
        assert!((factor.covariance() - posterior).norm() < 1e-12);
        assert_eq!(factor.0.upper_triangle(), Matrix3::from_diagonal(&factor.0.diagonal()));
    }

    #[test]
    fn an_almost_exact_measurement_leaves_a_positive_covariance() {
        let mut factor = CovarianceFactor::from_covariance(&(example() * 1e12)).unwrap();
        for _ in 0..50 {
            factor.measure_last(1e-24);
        }
        assert!(factor.is_sound());
        assert!(factor.0.row(2).norm_squared() <= 1e-24);
    }

    #[test]
    fn a_factor_of_no_covariance_is_refused() {
        assert_eq!(CovarianceFactor::from_covariance(&-Matrix3::<f64>::identity()), None);
    }
}
