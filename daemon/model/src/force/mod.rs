//! The known forces on a train.
//!
//! The declared model, all in N, along the direction of travel:
//!
//! ```text
//! mass (1 + gamma) dv/dt = traction - brake
//!                          - weight_kN (w0(v) + k mean(1/R) + tunnel_constant tunnel_length)
//!                          - weight_kN gradient
//! ```
//!
//! with the gradient in ‰ and the means taken along the train. [`ForceResolver`] gives everything but w0(v), the
//! quantity that estimators look for; [`ForceBalance::acceleration_mps2`] gives the acceleration. Each part is a law of
//! [`crate::terms`], with its declared numbers in the train and the line.

mod resolver;

use super::terms::rotating;
use super::train::TrainModel;
pub use resolver::{ForceResolver, ResolvedSample, ValidSample};

/// Returns the deceleration in m/s² that 1 N/kN of resistance, or 1 ‰ of climbing, causes.
#[inline]
pub fn mps2_per_n_per_kn(rotating_mass_factor: f64) -> f64 {
    TrainModel::weight_kn(1.0) / (1.0 + rotating_mass_factor)
}

/// Forces on a train at a moment, in the direction of travel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceBalance {
    /// Gross mass in kg.
    pub mass_kg: f64,
    /// gamma.
    pub rotating_mass_factor: f64,
    /// Traction less brake and all other forces in N.
    pub force_n: f64,
    /// Gradient in ‰ along the travel.
    pub gradient_permille: f64,
    /// Resistance in N/kN as p0 + p1 v + p2 v² of the speed in m/s.
    pub resistance_n_per_kn: [f64; 3],
}

impl ForceBalance {
    /// Returns the acceleration in m/s² as p0 + p1 v + p2 v² of the speed in m/s.
    #[inline]
    pub fn acceleration_mps2(&self) -> [f64; 3] {
        let per_kg = 1.0 / rotating::inertial_mass_kg(self.mass_kg, self.rotating_mass_factor);
        let weight_kn = TrainModel::weight_kn(self.mass_kg);
        let unit_mps2 = mps2_per_n_per_kn(self.rotating_mass_factor);
        let [w0, w1, w2] = self.resistance_n_per_kn;
        [
            per_kg * (self.force_n - weight_kn * self.gradient_permille) - unit_mps2 * w0,
            -unit_mps2 * w1,
            -unit_mps2 * w2,
        ]
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use dynocar_shared::{SampleField, TrainId, TrainSample};

    use super::*;
    use crate::train::{Davis, FrictionBrake};

    #[test]
    fn forces_balance_inertia() {
        let acting = ForceBalance {
            mass_kg: 100e3,
            rotating_mass_factor: 0.06,
            force_n: 80e3,
            gradient_permille: 5.0,
            resistance_n_per_kn: [1.5, 0.03, 0.001],
        };
        let [p0, p1, p2] = acting.acceleration_mps2();
        let speed_mps = 20.0;
        let weight_kn = 981.0;
        let left_n = 80e3 - weight_kn * (5.0 + 1.5 + 0.03 * 20.0 + 0.001 * 400.0);
        let accelerated_n = 1.06 * 100e3 * (p0 + speed_mps * (p1 + speed_mps * p2));
        assert!((accelerated_n - left_n).abs() < 1e-9 * 80e3);
        let on_a_unit_more = ForceBalance { gradient_permille: 6.0, ..acting };
        let taken_mps2 = p0 - on_a_unit_more.acceleration_mps2()[0];
        assert!((taken_mps2 - mps2_per_n_per_kn(0.06)).abs() < 1e-12);
    }

    #[test]
    fn a_brake_force_that_no_sample_carries_is_the_one_that_its_pressure_exerts() {
        let mut train = TrainModel::bare("", 1e5, Davis { a: 1.0, b: 0.0, c: 0.0 });
        let known = FrictionBrake { force_per_pressure_n_per_pa: 0.25, release_pressure_pa: 2e4 };
        let mut brake_n = |friction_brake, reported: &[(SampleField, f64)]| {
            train.brake_gear.friction_brake = friction_brake;
            let mut sample = TrainSample::empty(TrainId(1));
            for &(field, value) in reported {
                sample = sample.with(field, value);
            }
            let valid = ValidSample { sample: &sample, step_s: 0.0, segment: 1 };
            ForceResolver::new(Arc::new(train.clone()), None).resolve(&valid).brake_force_n
        };
        let pressure = (SampleField::BrakeCylinderPressure, 1.2e5);
        assert_eq!(brake_n(Some(known), &[pressure]), Some(25e3));
        assert_eq!(brake_n(Some(known), &[]), None);
        assert_eq!(brake_n(None, &[pressure]), None);
        let reported = (SampleField::BrakeForce, 40e3);
        assert_eq!(brake_n(Some(known), &[pressure, reported]), Some(40e3), "the whole force");
    }
}
