//! Speed polynomials in normalised coordinates.

use dynocar_model::train::Davis;
use nalgebra::{Matrix3, Vector3};

/// The shifted Legendre polynomials of v / scale, orthonormal over speeds from 0 to the scale.
///
/// On raw powers of a speed the squares of the regressors differ by a factor of 10⁸ in km/h
/// and 10⁵ in m/s, and gradient descent creeps along the weak directions; here they differ by
/// what the driven speeds make of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedBasis {
    scale_mps: f64,
}

impl SpeedBasis {
    /// A basis over speeds from 0 to `scale_mps`.
    pub fn new(scale_mps: f64) -> Self {
        SpeedBasis { scale_mps }
    }

    /// Speed in m/s that the basis is normalised by.
    pub fn scale_mps(&self) -> f64 {
        self.scale_mps
    }

    /// The three polynomials at a speed in m/s.
    pub fn at(&self, speed_mps: f64) -> Vector3<f64> {
        let x = speed_mps / self.scale_mps;
        Vector3::new(
            1.0,
            3.0_f64.sqrt() * (2.0 * x - 1.0),
            5.0_f64.sqrt() * (6.0 * x * x - 6.0 * x + 1.0),
        )
    }

    /// The matrix from coefficients in this basis to [a, b, c].
    pub fn to_davis_matrix(&self) -> Matrix3<f64> {
        let (second, third, scale) = (3.0_f64.sqrt(), 5.0_f64.sqrt(), self.scale_mps);
        Matrix3::new(
            1.0,
            -second,
            third,
            0.0,
            2.0 * second / scale,
            -6.0 * third / scale,
            0.0,
            0.0,
            6.0 * third / (scale * scale),
        )
    }

    /// Coefficients in this basis to a polynomial of speed.
    pub fn to_davis(&self, coefficients: &Vector3<f64>) -> Davis {
        let [a, b, c] = (self.to_davis_matrix() * coefficients).into();
        Davis { a, b, c }
    }

    /// A polynomial of speed to coefficients in this basis.
    pub fn of_davis(&self, davis: &Davis) -> Vector3<f64> {
        let (second, third, scale) = (3.0_f64.sqrt(), 5.0_f64.sqrt(), self.scale_mps);
        let quadratic = davis.c * scale * scale / (6.0 * third);
        let linear = (davis.b * scale + 6.0 * third * quadratic) / (2.0 * second);
        Vector3::new(davis.a + second * linear - third * quadratic, linear, quadratic)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DAVIS: Davis = Davis { a: 2.8, b: 0.057, c: 0.0099 };

    #[test]
    fn a_polynomial_survives_the_way_there_and_back() {
        let basis = SpeedBasis::new(31.0);
        let coefficients = basis.of_davis(&DAVIS);
        for speed_mps in [0.0, 7.0, 31.0] {
            let value = coefficients.dot(&basis.at(speed_mps));
            assert!((value - DAVIS.w0_n_per_kn(speed_mps)).abs() < 1e-12);
        }
        let back = basis.to_davis(&coefficients);
        assert!((back.a - DAVIS.a).abs() < 1e-12 && (back.c - DAVIS.c).abs() < 1e-15);
    }

    #[test]
    fn the_polynomials_are_orthonormal_over_their_range() {
        let (basis, steps) = (SpeedBasis::new(20.0), 20_000);
        let mut gram = Matrix3::zeros();
        for k in 0..steps {
            let phi = basis.at(20.0 * (k as f64 + 0.5) / steps as f64);
            gram += phi * phi.transpose() / steps as f64;
        }
        assert!((gram - Matrix3::identity()).norm() < 1e-6);
    }
}
