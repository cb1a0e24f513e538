//! Parts of the model of the mass estimators: basic, curve and tunnel resistance as functions of speed, with the
//! polynomials in which they are learned, and the acceleration over time that the forces do not explain.

use dynocar_core::pipeline::motion::jump_variance;
use dynocar_model::track::gradient_error_kept;
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

/// Speed in m/s at which the bias of a behaviour that grows with speed is stated.
const GROWTH_REFERENCE_MPS: f64 = 20.0;
/// Least shape at which an error of the map counts as such a bias.
const SHAPE_MIN: f64 = 0.25;

/// Effect of the error of the map's gradients over a step: see [`gradient_error_kept`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapError {
    /// Standard deviation of the effect in m/s²; 0 where no error is declared.
    pub std_mps2: f64,
    /// Share of the effect that is still there after the step.
    pub keep: f64,
}

impl MapError {
    /// Returns the effect over a step in s that begins with a motion; `mps2_per_permille` turns gradients into
    /// accelerations.
    pub fn over(motion: &KnownMotion, step_s: f64, mps2_per_permille: f64) -> Self {
        if motion.gradient_std_permille <= 0.0 {
            return MapError { std_mps2: 0.0, keep: 1.0 };
        }
        MapError {
            std_mps2: mps2_per_permille * motion.gradient_std_permille,
            keep: gradient_error_kept(motion.speed_mps * step_s),
        }
    }
}

/// An Ornstein-Uhlenbeck process: how a bias behaves in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiasModel {
    /// Standard deviation in m/s².
    pub std_mps2: f64,
    /// Correlation time in s; infinite for a constant.
    pub time_s: f64,
    /// True when the bias is proportional to speed, as the drag of a headwind is; the
    /// deviation then holds at 20 m/s.
    pub grows_with_speed: bool,
}

impl BiasModel {
    /// Returns a behaviour.
    pub fn new(std_mps2: f64, time_s: f64, grows_with_speed: bool) -> Self {
        BiasModel { std_mps2, time_s, grows_with_speed }
    }

    /// Returns whether the behaviour lets forces jump between samples; one that lasts for ever takes them for straight
    /// there.
    pub fn knows_of_jumps(&self) -> bool {
        self.time_s.is_finite()
    }

    /// Returns the variance in (m/s)² of the error of a step because the acceleration changes by so much over it.
    pub fn jump_variance(&self, change_mps2: f64, step_s: f64) -> f64 {
        if self.knows_of_jumps() { jump_variance(change_mps2, step_s) } else { 0.0 }
    }

    /// Returns the share of the bias that is left after a time in s.
    pub fn keep(&self, step_s: f64) -> f64 {
        (-step_s / self.time_s).exp()
    }

    /// Returns the variance in (m/s²)² of the noise that renews the bias while a share of it stays.
    pub fn noise_variance(&self, keep: f64) -> f64 {
        self.std_mps2 * self.std_mps2 * (1.0 - keep * keep)
    }

    /// Returns the standard deviation of the bias where nothing is known of it, in addition to a map's error of a
    /// standard deviation in m/s² at a speed in m/s.
    pub fn std_given_others_mps2(&self, map_std_mps2: f64, speed_mps: f64) -> f64 {
        self.std_mps2.hypot(self.of_map(map_std_mps2, speed_mps))
    }

    /// Returns the share of the bias that stays over a step and the variance of the noise that renews it, where a share
    /// `keep` of it would stay but for the map's error.
    ///
    /// Bias and error are one process here: its variance is the sum of the two, its correlation over the
    /// step their mean weighted by the variances.
    pub fn drift(&self, keep: f64, map: &MapError, speed_mps: f64) -> (f64, f64) {
        if map.std_mps2 <= 0.0 {
            return (keep, self.noise_variance(keep));
        }
        let own = self.std_mps2 * self.std_mps2;
        let both = own + self.of_map(map.std_mps2, speed_mps).powi(2);
        let keep = (own * keep + (both - own) * map.keep) / both;
        (keep, both * (1.0 - keep * keep))
    }

    /// Returns the map's error in units of the bias, which may be stated at another speed.
    fn of_map(&self, map_std_mps2: f64, speed_mps: f64) -> f64 {
        map_std_mps2 / self.shape(speed_mps).max(SHAPE_MIN)
    }

    /// Bias in m/s² at a speed in m/s for a stated bias of 1 m/s².
    pub fn shape(&self, speed_mps: f64) -> f64 {
        if self.grows_with_speed { speed_mps / GROWTH_REFERENCE_MPS } else { 1.0 }
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

#[cfg(test)]
mod bias_model_tests {
    use super::*;

    #[test]
    fn a_bias_next_to_an_error_of_the_map_has_the_variance_and_correlation_of_their_sum() {
        let bias = BiasModel::new(0.01, 60.0, false);
        let map = MapError { std_mps2: 0.02, keep: gradient_error_kept(5.0) };
        let (keep, noise_variance) = bias.drift(bias.keep(0.5), &map, 10.0);
        let both = bias.std_given_others_mps2(0.02, 10.0).powi(2);
        assert!((both - 5e-4).abs() < 1e-15);
        let product = 1e-4 * (-0.5_f64 / 60.0).exp() + 4e-4 * (-0.05_f64).exp();
        assert!((both * keep - product).abs() < 1e-15, "what is common to both ends of the step");
        assert!((keep * keep * both + noise_variance - both).abs() < 1e-15, "stationary");
    }

    #[test]
    fn a_line_without_stated_uncertainty_changes_no_behaviour() {
        let map = MapError { std_mps2: 0.0, keep: 1.0 };
        for (time_s, grows) in [(f64::INFINITY, false), (60.0, true), (10.0, false)] {
            let bias = BiasModel::new(0.01, time_s, grows);
            let keep = bias.keep(0.2);
            assert_eq!(bias.drift(keep, &map, 3.0), (keep, bias.noise_variance(keep)));
            assert_eq!(bias.std_given_others_mps2(0.0, 3.0), bias.std_mps2);
        }
    }
}
