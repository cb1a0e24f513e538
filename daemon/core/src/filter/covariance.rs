//! Covariances after a scalar measurement and after a step of time, in full or as a lower triangular factor L with
//! P = L Lᵀ.
//!
//! The factor keeps P symmetric and positive even if its entries differ by many orders of magnitude (Bierman 1977,
//! Factorization Methods for Discrete Sequential Estimation; Carlson 1973 for the update).

use nalgebra::{SMatrix, SVector};

/// Least share of the variance along a row that a measurement may leave before Joseph's form is
/// needed: subtracting loses as many digits as the variance shrinks by.
const SHARE_LEFT_MIN: f64 = 1e-3;

/// Takes a measurement `row` · x + noise with the best gain into a symmetric covariance, and
/// keeps it symmetric and positive.
///
/// `spread` is P hᵀ, `inverse_variance` one over the innovation's variance. A measurement shrinks one direction only,
/// by the ratio of noise to innovation variance. Unless that ratio is small, P - S Sᵀ / v keeps its digits and is used;
/// where nearly all of a variance goes, as from a wide prior, Joseph's form is used.
///
/// # Real-time
///
/// Bounded work, no allocation.
#[inline(always)]
pub(super) fn measured<const N: usize>(
    covariance: &mut SMatrix<f64, N, N>,
    row: &SVector<f64, N>,
    spread: &SVector<f64, N>,
    inverse_variance: f64,
    noise_variance: f64,
) {
    if noise_variance * inverse_variance < SHARE_LEFT_MIN {
        *covariance = wide(*covariance, *row, *spread, inverse_variance, noise_variance);
    } else {
        // Products before the factor: the result is exactly symmetric. One loop: a matrix of products costs its memory.
        for j in 0..N {
            for i in 0..N {
                covariance[(i, j)] -= (spread[i] * spread[j]) * inverse_variance;
            }
        }
    }
}

/// Joseph's form, away from the usual way and all by value, so that there nothing leaves its registers.
#[cold]
#[inline(never)]
fn wide<const N: usize>(
    mut covariance: SMatrix<f64, N, N>,
    row: SVector<f64, N>,
    spread: SVector<f64, N>,
    inverse_variance: f64,
    noise_variance: f64,
) -> SMatrix<f64, N, N> {
    let gain = spread * inverse_variance;
    joseph(&mut covariance, &row, &spread, &gain, noise_variance);
    covariance
}

/// F P Fᵀ + Q, exactly symmetric.
///
/// # Real-time
///
/// Bounded work, no allocation.
#[inline]
pub(super) fn moved<const N: usize>(
    transition: &SMatrix<f64, N, N>,
    covariance: &SMatrix<f64, N, N>,
    noise: &SMatrix<f64, N, N>,
) -> SMatrix<f64, N, N> {
    let mut moved = transition * covariance * transition.transpose() + noise;
    for j in 0..N {
        for i in 0..j {
            moved[(j, i)] = moved[(i, j)];
        }
    }
    moved
}

/// Takes a measurement `row` · x + noise into a symmetric covariance:
/// P ← (I - K h) P (I - K h)ᵀ + K R Kᵀ, which keeps P positive regardless of the rounding of K.
///
/// `spread` is P hᵀ. The two products are taken one after the other, each as a correction of
/// rank one, so that the work grows with N² where full products would take N³; only half of the
/// symmetric result is formed.
///
/// # Real-time
///
/// Bounded work, no allocation.
fn joseph<const N: usize>(
    covariance: &mut SMatrix<f64, N, N>,
    row: &SVector<f64, N>,
    spread: &SVector<f64, N>,
    gain: &SVector<f64, N>,
    noise_variance: f64,
) {
    // A = (I - K h) P, then A - (A hᵀ) Kᵀ + K R Kᵀ.
    let mut reduced = *covariance;
    let mut rest = SVector::<f64, N>::zeros();
    for j in 0..N {
        for i in 0..N {
            reduced[(i, j)] -= gain[i] * spread[j];
            rest[i] += reduced[(i, j)] * row[j];
        }
    }
    let back = gain * noise_variance - rest;
    for j in 0..N {
        for i in 0..j {
            let upper = reduced[(i, j)] + back[i] * gain[j];
            let lower = reduced[(j, i)] + back[j] * gain[i];
            let mean = 0.5 * (upper + lower);
            covariance[(i, j)] = mean;
            covariance[(j, i)] = mean;
        }
        covariance[(j, j)] = reduced[(j, j)] + back[j] * gain[j];
    }
}

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
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn either_form_is_the_inverse_of_the_summed_information() {
        let prior = Matrix3::new(4.0, 1.0, -0.5, 1.0, 3.0, 0.7, -0.5, 0.7, 2.0);
        let row = Vector3::new(0.3, -1.0, 2.0);
        for noise_variance in [2.0, 1e-3] {
            let spread = prior * row;
            let variance = row.dot(&spread) + noise_variance;
            let mut covariance = prior;
            measured(&mut covariance, &row, &spread, 1.0 / variance, noise_variance);
            let information = prior.try_inverse().unwrap() + row * row.transpose() / noise_variance;
            let expected = information.try_inverse().unwrap();
            assert!((covariance - expected).norm() < 1e-6 * expected.norm());
            assert_eq!(covariance, covariance.transpose());
            assert!(covariance.cholesky().is_some());
        }
    }

    #[test]
    fn a_wide_prior_and_exact_rows_leave_a_positive_covariance() {
        let mut covariance = Matrix3::identity() * 1e12;
        for k in 0..200 {
            let x = 1.0 + 1e-3 * f64::from(k % 7);
            let row = Vector3::new(1.0, x, x * x);
            let spread = covariance * row;
            let variance = row.dot(&spread) + 1.0;
            measured(&mut covariance, &row, &spread, 1.0 / variance, 1.0);
            assert!(covariance.cholesky().is_some(), "row {k}");
        }
    }

    #[test]
    fn corrections_of_rank_one_give_josephs_products() {
        let prior = Matrix3::new(4.0, 1.0, -0.5, 1.0, 3.0, 0.7, -0.5, 0.7, 2.0);
        let row = Vector3::new(0.3, -1.0, 2.0);
        let noise_variance = 0.5;
        let spread = prior * row;
        // Any gain: Joseph's form holds for other gains than the best, too.
        for share in [1.0, 0.7] {
            let gain = spread * (share / (row.dot(&spread) + noise_variance));
            let keep = Matrix3::identity() - gain * row.transpose();
            let expected =
                keep * prior * keep.transpose() + gain * gain.transpose() * noise_variance;
            let mut covariance = prior;
            joseph(&mut covariance, &row, &spread, &gain, noise_variance);
            assert!((covariance - expected).norm() < 1e-14);
            assert_eq!(covariance, covariance.transpose());
        }
    }
}

#[cfg(test)]
mod square_root_tests {
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
