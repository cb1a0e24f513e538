//! Unknowns that are the same in all passes of a vehicle: resistance, mass, passengers, time offset.

use nalgebra::{SMatrix, SVector};

use super::observation::BlockDifference;

/// Acceleration of gravity in m/s².
pub const GRAVITY_MPS2: f64 = 9.81;

/// The common unknowns: a, b, c in N/kN (v in m/s), the factor on the declared mass less 1, the time in s by which
/// forces act before their time stamps, and the mass of a passenger in kg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Common(pub SVector<f64, { Common::COUNT }>);

impl Common {
    /// Number of unknowns.
    pub const COUNT: usize = 6;

    /// Davis coefficients in N/kN.
    pub fn davis(&self) -> [f64; 3] {
        [self.0[0], self.0[1], self.0[2]]
    }

    /// True over declared mass, less 1.
    pub fn mass_share(&self) -> f64 {
        self.0[3]
    }

    /// Returns the time in s by which forces act before their time stamps.
    pub fn delay_s(&self) -> f64 {
        self.0[4]
    }

    /// Returns the mass of a passenger in kg.
    pub fn passenger_kg(&self) -> f64 {
        self.0[5]
    }
}

/// Declared values of a vehicle, and their uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Declared mass in kg, without counted passengers.
    pub mass_kg: f64,
    /// Declared mass of a passenger in kg.
    pub passenger_kg: f64,
    /// Rotating-mass factor: it scales like the force and stays as declared.
    pub rotating_mass_factor: f64,
    /// Declared Davis coefficients in N/kN.
    pub davis: [f64; 3],
    /// Typical speed in m/s.
    pub speed_mps: f64,
    /// True when the recordings declare a weighed mass, rather than a nominal one.
    pub is_weighed: bool,
    /// True when passengers are counted.
    pub has_passengers: bool,
}

impl Prior {
    /// Returns the declared values.
    pub fn start(&self) -> Common {
        let [a, b, c] = self.davis;
        Common(SVector::from([a, b, c, 0.0, 0.0, self.passenger_kg]))
    }

    /// Returns the standard deviations of the unknowns before the recordings.
    ///
    /// The resistance at the typical speed is believed within half of itself and 1 N/kN, however
    /// it is shared out between a, b and c.
    fn std(&self) -> [f64; Common::COUNT] {
        let [a, b, c] = self.davis;
        let speed = self.speed_mps.max(3.0);
        let usual = (a + speed * (b + speed * c)).abs();
        let share = 0.5 * usual + 1.0;
        let passenger = if self.has_passengers { 15.0 } else { 1e-3 };
        let mass = if self.is_weighed { 0.02 } else { 0.15 };
        [share, 0.3 * share / speed, 0.7 * share / (speed * speed), mass, 0.3, passenger]
    }

    /// Normal matrix and right-hand side of the prior at a point.
    pub fn rows(
        &self,
        now: &Common,
    ) -> (SMatrix<f64, { Common::COUNT }, { Common::COUNT }>, SVector<f64, { Common::COUNT }>) {
        let weights = SVector::from(self.std().map(|std| 1.0 / (std * std)));
        let away = self.start().0 - now.0;
        (SMatrix::from_diagonal(&weights), weights.component_mul(&away))
    }

    /// Returns the force in N for each kg, without the gradient.
    pub fn unit_force(&self, observation: &BlockDifference, common: &Common) -> f64 {
        let [a, b, c] = common.davis();
        let speed = observation.speed_mps;
        (1.0 + self.rotating_mass_factor) * observation.acceleration_mps2
            + GRAVITY_MPS2 * (a + speed * (b + speed * c) + observation.curve_n_per_kn) / 1000.0
    }

    /// Returns the mass in kg at an observation.
    pub fn mass_kg(&self, observation: &BlockDifference, common: &Common) -> f64 {
        let counted = observation.passengers * (common.passenger_kg() - self.passenger_kg);
        observation.mass_kg + self.mass_kg * common.mass_share() + counted
    }

    /// Returns the change of the modelled force by each unit of the unknowns, in N.
    pub fn slopes(
        &self,
        observation: &BlockDifference,
        mass_kg: f64,
        unit: f64,
    ) -> [f64; Common::COUNT] {
        let weight_kn = mass_kg * GRAVITY_MPS2 / 1000.0;
        let speed = observation.speed_mps;
        [
            weight_kn,
            weight_kn * speed,
            weight_kn * speed * speed,
            self.mass_kg * unit,
            -observation.force_change_n,
            observation.passengers * unit,
        ]
    }
}
