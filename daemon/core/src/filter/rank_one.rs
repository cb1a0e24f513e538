//! The covariance after a scalar measurement, in Joseph's form.

use nalgebra::{SMatrix, SVector};

/// Takes a measurement `row` · x + noise into a symmetric covariance:
/// P ← (I - K h) P (I - K h)ᵀ + K R Kᵀ, which keeps P positive whatever the rounding of K.
///
/// `spread` is P hᵀ. The two products are taken one after the other, each as a correction of
/// rank one, so that the work grows with N² where full products would take N³; only half of the
/// symmetric result is formed.
///
/// # Real-time
///
/// Bounded work, no allocation.
#[inline]
pub(super) fn joseph<const N: usize>(
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
