//! Basic, curve and tunnel resistance as functions of speed, and the polynomials in which they are learned.

use dynocar_model::train::{Davis, TrainModel};
use nalgebra::{Matrix3, Vector3};

use super::known_motion::KnownMotion;

/// Resistance of a train on a line, in N/kN: Wang 2022, eq. (5), (9), (10), with each polynomial weighted by the share
/// of it that acts.
///
/// The paper's curve resistance z2 knows no radius. Here it holds at a reference radius and is proportional to 1/R, as
/// in all curve formulas; on a line of equal radii the two are the same. z2 and z3 come in addition to the declared
/// resistance of curves, tunnels and the rest ([`KnownMotion::known_n_per_kn`]), which always acts: the paper declares
/// none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineResistance {
    /// z1: basic resistance.
    pub basic: Davis,
    /// z2: curve resistance with the whole train at the reference radius, beyond the declared.
    pub curve: Option<Davis>,
    /// z3: tunnel resistance with the whole train in a tunnel, beyond the declared.
    pub tunnel: Option<Davis>,
    /// Radius in m that z2 holds at.
    pub reference_radius_m: f64,
}

impl LineResistance {
    /// Returns the declared resistance of a train.
    pub fn declared(train: &TrainModel) -> Self {
        LineResistance {
            basic: train.resistance,
            curve: None,
            tunnel: None,
            reference_radius_m: DEFAULT_REFERENCE_RADIUS_M,
        }
    }

    /// Returns all that retards in N/kN at a speed in m/s: this resistance plus all known forces.
    #[inline]
    pub fn w_n_per_kn(&self, motion: &KnownMotion, speed_mps: f64) -> f64 {
        let curve = self.curve.map_or(0.0, |curve| {
            self.reference_radius_m * motion.curvature_per_m * curve.w0_n_per_kn(speed_mps)
        });
        let tunnel =
            self.tunnel.map_or(0.0, |tunnel| motion.tunnel_share * tunnel.w0_n_per_kn(speed_mps));
        self.basic.w0_n_per_kn(speed_mps) + curve + tunnel + motion.known_n_per_kn
    }

    /// Derivative of the resistance after speed, in N/kN per m/s.
    #[inline]
    pub fn slope(&self, motion: &KnownMotion, speed_mps: f64) -> f64 {
        let slope = |davis: Davis| davis.b + 2.0 * davis.c * speed_mps;
        let curve = self
            .curve
            .map_or(0.0, |curve| self.reference_radius_m * motion.curvature_per_m * slope(curve));
        let tunnel = self.tunnel.map_or(0.0, |tunnel| motion.tunnel_share * slope(tunnel));
        slope(self.basic) + curve + tunnel
    }
}

/// Radius in m that curve resistance refers to unless set otherwise.
pub const DEFAULT_REFERENCE_RADIUS_M: f64 = 500.0;

/// The shifted Legendre polynomials of v / scale, orthonormal over speeds from 0 to the scale.
///
/// On raw powers of a speed the squares of the regressors differ by a factor of 10⁸ in km/h and 10⁵ in m/s, and
/// gradient descent creeps along the weak directions; here they differ only as the distribution of the driven speeds
/// makes them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedBasis {
    /// Speed in m/s that the basis is normalised by.
    pub scale_mps: f64,
}

impl SpeedBasis {
    /// Returns a basis over speeds from 0 to `scale_mps`.
    pub fn new(scale_mps: f64) -> Self {
        SpeedBasis { scale_mps }
    }

    /// Returns the three polynomials at a speed in m/s.
    pub fn at(&self, speed_mps: f64) -> Vector3<f64> {
        let x = speed_mps / self.scale_mps;
        Vector3::new(
            1.0,
            3.0_f64.sqrt() * (2.0 * x - 1.0),
            5.0_f64.sqrt() * (6.0 * x * x - 6.0 * x + 1.0),
        )
    }

    /// Returns the matrix from coefficients in this basis to [a, b, c].
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

    /// Returns the coefficients in this basis to a polynomial of speed.
    pub fn to_davis(&self, coefficients: &Vector3<f64>) -> Davis {
        let [a, b, c] = (self.to_davis_matrix() * coefficients).into();
        Davis { a, b, c }
    }

    /// Returns a polynomial of speed to coefficients in this basis.
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
