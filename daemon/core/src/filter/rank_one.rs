//! The covariance after a scalar measurement, and after a step of time.

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
