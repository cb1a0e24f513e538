//! What forces do to a train of a reference mass.

use dynocar_model::force::balance;
use dynocar_model::terms::rotating;
use dynocar_model::train::TrainModel;

use super::motion::Motion;

/// A train's mass as declared, which the unknown inverse mass refers to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    /// Mass in kg that the inverse mass refers to.
    pub reference_mass_kg: f64,
    /// gamma.
    pub rotating_mass_factor: f64,
}

impl Inertia {
    /// That of a train.
    pub fn of(train: &TrainModel) -> Self {
        let TrainModel { mass_kg, rotating_mass_factor, .. } = *train;
        Inertia { reference_mass_kg: mass_kg, rotating_mass_factor }
    }

    /// Acceleration in m/s² of the force on the reference mass.
    #[inline]
    pub fn push_mps2(&self, motion: &Motion) -> f64 {
        motion.force_n / self.inertial_mass_kg(self.reference_mass_kg)
    }

    /// m/s² of one N/kN.
    #[inline]
    pub fn mps2_per_n_per_kn(&self) -> f64 {
        balance::mps2_per_n_per_kn(self.rotating_mass_factor)
    }

    /// Mass in kg that a force accelerates when the train has a mass in kg.
    #[inline]
    pub fn inertial_mass_kg(&self, mass_kg: f64) -> f64 {
        rotating::inertial_mass_kg(mass_kg, self.rotating_mass_factor)
    }
}
