//! What accelerates the train at one sample.

use crate::force::ResolvedSample;
use crate::terms::{Resistance, rotating};
use crate::train::{Davis, TrainModel};

/// What accelerates the train at one sample; effects change these fields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleForces {
    /// Declared gross mass in kg.
    pub mass_kg: f64,
    /// True traction force in N.
    pub traction_n: f64,
    /// True brake force in N, retarding.
    pub brake_n: f64,
    /// True over declared mass.
    pub mass_factor: f64,
    /// Rotating-mass factor gamma.
    pub rotating_mass_factor: f64,
    /// Gradient in ‰ along the travel.
    pub gradient_permille: f64,
    /// What resists, part by part, but for a, b and c.
    pub resistance: Resistance,
    /// Further resistance in N.
    pub extra_n: f64,
}

impl SampleForces {
    /// As declared.
    #[inline]
    pub fn declared(sample: &ResolvedSample, rotating_mass_factor: f64) -> Self {
        SampleForces {
            mass_kg: sample.mass_kg,
            traction_n: sample.traction_force_n.unwrap_or(0.0),
            brake_n: sample.brake_force_n.unwrap_or(0.0),
            mass_factor: 1.0,
            rotating_mass_factor,
            gradient_permille: sample.gradient_permille.unwrap_or(0.0),
            resistance: sample.resistance,
            extra_n: 0.0,
        }
    }

    /// Acceleration in m/s² that 1 N/kN of resistance takes away.
    #[inline]
    fn per_unit_resistance_mps2(&self) -> f64 {
        TrainModel::weight_kn(1.0) / (1.0 + self.rotating_mass_factor)
    }

    /// The acceleration p0 + p1 v + p2 v² in m/s² for speeds near `speed_mps`.
    #[inline]
    pub fn polynomial(&self, davis: Davis, speed_mps: f64) -> [f64; 3] {
        let mass_kg = self.mass_kg * self.mass_factor;
        let per_kg = 1.0 / rotating::inertial_mass_kg(mass_kg, self.rotating_mass_factor);
        let weight_kn = TrainModel::weight_kn(mass_kg);
        let force_n = self.traction_n - self.brake_n - self.extra_n;
        let unit = self.per_unit_resistance_mps2();
        let [w0, w1, w2] = self.resistance.polynomial(davis, speed_mps);
        [
            per_kg * (force_n - weight_kn * self.gradient_permille) - unit * w0,
            -unit * w1,
            -unit * w2,
        ]
    }

    /// What the acceleration changes by for each ‰ of gradient along the travel.
    #[inline]
    pub(super) fn gradient_slope(&self) -> f64 {
        -self.per_unit_resistance_mps2()
    }

    /// What the acceleration changes by for each unit of a, b and c.
    #[inline]
    pub(super) fn davis_slopes(&self, speed_mps: f64) -> [f64; 3] {
        let unit = self.per_unit_resistance_mps2();
        self.resistance.davis_slopes(speed_mps).map(|slope| -unit * slope)
    }
}
