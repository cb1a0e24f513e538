//! Response of a filter's estimate to a disturbance of unit density.
//!
//! With the gains that a filter has used, the covariance of its estimate is linear in the densities of the noise. This
//! module follows the disturbance's part for a density of 1 (m/s)²/s; at the best gains it is also the derivative of
//! the covariance with respect to the density, since the derivative with respect to the gains vanishes.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::SPEED;

/// Covariance of [a, b, c, v] from a disturbance of unit density.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UnitDisturbance(SMatrix<f64, 4, 4>);

impl UnitDisturbance {
    /// Returns the part of a, b and c.
    pub fn of_davis(&self) -> Matrix3<f64> {
        self.0.fixed_view::<3, 3>(0, 0).into_owned()
    }

    /// The speed has been taken from a measurement alone.
    pub fn anchor(&mut self) {
        self.0.row_mut(SPEED).fill(0.0);
        self.0.column_mut(SPEED).fill(0.0);
    }

    /// A step with the derivatives of the speed after it.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    #[inline]
    pub fn predict(&mut self, by_davis: &Vector3<f64>, by_speed: f64, duration_s: f64) {
        let row = SVector::<f64, 4>::new(by_davis[0], by_davis[1], by_davis[2], by_speed);
        let with_speed = self.0 * row;
        let own = row.dot(&with_speed);
        self.0.set_column(SPEED, &with_speed);
        self.0.set_row(SPEED, &with_speed.transpose());
        self.0[(SPEED, SPEED)] = own + duration_s;
    }

    /// A measurement of the speed that was taken in with a gain.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    #[inline]
    pub fn measure(&mut self, gain: &SVector<f64, 4>) {
        let seen = self.0.column(SPEED).into_owned();
        // (I - K h) U (I - K h)ᵀ, exactly symmetric.
        let taken = seen - gain * (0.5 * seen[SPEED]);
        self.0 -= gain * taken.transpose() + taken * gain.transpose();
    }

    /// Returns the mean of two by the share of the other.
    pub fn mixed(&self, other: &UnitDisturbance, share: f64) -> UnitDisturbance {
        UnitDisturbance(self.0 * (1.0 - share) + other.0 * share)
    }
}

#[cfg(test)]
mod tests {
    use super::super::hypothesis::{JumpHypothesis, OutlierModel};
    use super::super::noise::{LearnedNoise, NoiseModel};
    use super::super::step::StepRule;
    use super::super::test_runs::{FAST, speeds, steps};
    use super::*;

    /// Returns the covariance after a run, with its part by the disturbance.
    fn covariance(density: f64) -> (Matrix3<f64>, Matrix3<f64>) {
        let rule = StepRule::Time;
        let steps = steps(rule, 400);
        let speeds = speeds(rule, &steps, &FAST, 30.0);
        let model = NoiseModel {
            speed_noise_mps: 0.1,
            speed_noise_range_mps: (1e-3, 1.0),
            disturbance: density.sqrt(),
            disturbance_range: (0.0, 1.0),
            memory: 1000.0,
            learns_speed_noise: false,
            learns_disturbance: false,
        };
        let std = Vector3::new(0.3, 0.01, 0.0004);
        let mut filter = JumpHypothesis::new(&FAST, &std, LearnedNoise::new(&model));
        filter.anchor(speeds[0]);
        let outliers = OutlierModel { share: 1e-9, density: 0.5 };
        for (step, &speed_mps) in steps.iter().zip(&speeds[1..]) {
            filter.predict(rule, step, step.size, 0.0);
            filter.measure(speed_mps, &model, &outliers);
        }
        (filter.davis_covariance(), filter.unit_disturbance().of_davis())
    }

    #[test]
    fn it_is_the_derivative_of_the_covariance_with_respect_to_the_density() {
        let (density, width) = (1e-4, 1e-6);
        let (more, less) = (covariance(density + width).0, covariance(density - width).0);
        let slope = (more - less) / (2.0 * width);
        let unit = covariance(density).1;
        for i in 0..3 {
            let ratio = unit[(i, i)] / slope[(i, i)];
            assert!((ratio - 1.0).abs() < 1e-3, "{i}: {ratio}");
        }
    }
}
