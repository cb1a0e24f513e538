//! A covariance as its lower triangular factor L, P = L Lᵀ.
//!
//! The factor keeps P symmetric and positive whatever the ratio of its entries (Bierman 1977,
//! Factorization Methods for Discrete Sequential Estimation; Carlson 1973 for the update).

use nalgebra::{SMatrix, SVector};

/// What a scalar measurement said, before the state was moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain<const N: usize> {
    /// How far the state moves for an innovation of 1.
    pub gain: SVector<f64, N>,
    /// Variance of the innovation.
    pub innovation_variance: f64,
}

/// Lower triangular factor of a covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CovarianceFactor<const N: usize>(pub SMatrix<f64, N, N>);

impl<const N: usize> CovarianceFactor<N> {
    /// Uncorrelated states of given standard deviations.
    pub fn diagonal(deviations: &SVector<f64, N>) -> Self {
        CovarianceFactor(SMatrix::from_diagonal(deviations))
    }

    /// The factor of a covariance; `None` when it is not positive definite.
    pub fn of(covariance: &SMatrix<f64, N, N>) -> Option<Self> {
        Some(CovarianceFactor(covariance.cholesky()?.unpack()))
    }

    /// P = L Lᵀ.
    pub fn covariance(&self) -> SMatrix<f64, N, N> {
        self.0 * self.0.transpose()
    }

    /// Variance of hᵀ x.
    pub fn variance_along(&self, direction: &SVector<f64, N>) -> f64 {
        self.0.tr_mul(direction).norm_squared()
    }

    /// Updates the covariance by a measurement hᵀ x + noise of variance r > 0.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn measure(&mut self, direction: &SVector<f64, N>, noise_variance: f64) -> Gain<N> {
        let along =
            SVector::from_fn(|j, _| (j..N).map(|i| self.0[(i, j)] * direction[i]).sum::<f64>());
        self.measure_along(&along, noise_variance)
    }

    /// As [`CovarianceFactor::measure`] for a measurement of the last component, whose w is a row
    /// of the factor.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    #[inline]
    pub fn measure_last(&mut self, noise_variance: f64) -> Gain<N> {
        let along = self.0.row(N - 1).transpose();
        self.measure_along(&along, noise_variance)
    }

    /// The update for w = Lᵀ h.
    ///
    /// Only sums of positive terms are formed: with S_k = r + Σ_{j>=k} w_j², the factor of
    /// I - w wᵀ / S_1 has the diagonal √(S_{k+1} / S_k) and, below it, -w_j w_k / √(S_k S_{k+1}).
    #[inline]
    fn measure_along(&mut self, along: &SVector<f64, N>, noise_variance: f64) -> Gain<N> {
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
        Gain { gain: carried * (1.0 / sum), innovation_variance: sum }
    }

    /// True while every entry is a number and no variance is zero.
    #[inline]
    pub fn is_sound(&self) -> bool {
        // One infinity or NaN makes the sum one.
        self.0.column_sum().sum().is_finite() && (0..N).all(|i| self.0[(i, i)] != 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    fn example() -> Matrix3<f64> {
        Matrix3::new(4.0, 1.0, -0.5, 1.0, 3.0, 0.7, -0.5, 0.7, 2.0)
    }

    #[test]
    fn an_update_is_the_kalman_filters() {
        let prior = example();
        let direction = Vector3::new(0.3, -1.0, 2.0);
        let noise = 0.5;
        let mut factor = CovarianceFactor::of(&prior).unwrap();
        let result = factor.measure(&direction, noise);
        let variance = (direction.transpose() * prior * direction)[0] + noise;
        let gain = prior * direction / variance;
        let posterior = prior - gain * gain.transpose() * variance;
        assert!((result.innovation_variance - variance).abs() < 1e-12);
        assert!((result.gain - gain).norm() < 1e-12);
        assert!((factor.covariance() - posterior).norm() < 1e-12);
        assert_eq!(factor.0.upper_triangle(), Matrix3::from_diagonal(&factor.0.diagonal()));
    }

    #[test]
    fn measuring_the_last_component_is_measuring_along_it() {
        let (mut one, mut other) =
            (CovarianceFactor::of(&example()).unwrap(), CovarianceFactor::of(&example()).unwrap());
        let along = one.measure(&Vector3::new(0.0, 0.0, 1.0), 0.5);
        assert_eq!(other.measure_last(0.5), along);
        assert_eq!(other, one);
    }

    #[test]
    fn an_almost_exact_measurement_leaves_a_positive_covariance() {
        let mut factor = CovarianceFactor::of(&example()).unwrap();
        for _ in 0..50 {
            factor.measure(&Vector3::new(1.0, 1e3, 1e6), 1e-24);
        }
        assert!(factor.is_sound());
        assert!(factor.variance_along(&Vector3::new(1.0, 1e3, 1e6)) <= 1e-24);
    }

    #[test]
    fn a_factor_of_no_covariance_is_refused() {
        assert_eq!(CovarianceFactor::of(&-Matrix3::<f64>::identity()), None);
    }
}
