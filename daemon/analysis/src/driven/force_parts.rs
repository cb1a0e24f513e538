//! The forces at one moment, part by part.

use dynocar_model::train::{Davis, TrainModel};

use crate::explain::evidence::SampleForces;

/// A force along the travel. Retarding forces are positive; traction is positive when it drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ForcePart {
    /// Traction force that acts, after gain and delay.
    Traction,
    /// Brake force that acts, after the delay.
    Brake,
    /// Weight along the gradient.
    Gradient,
    /// Basic resistance by the Davis coefficients.
    Basic,
    /// Curve resistance.
    Curve,
    /// Tunnels, by their length, as share of c and in addition to it.
    Tunnel,
    /// Addition of the wind to the air resistance.
    Wind,
    /// Addition of the temperature to the basic resistance.
    Ambient,
    /// Cold bearings.
    Bearing,
    /// Resistance at certain places.
    Location,
    /// Forces outside the library, by their form.
    Other,
}

impl ForcePart {
    /// Every part.
    pub const ALL: [ForcePart; 11] = [
        ForcePart::Traction,
        ForcePart::Brake,
        ForcePart::Gradient,
        ForcePart::Basic,
        ForcePart::Curve,
        ForcePart::Tunnel,
        ForcePart::Wind,
        ForcePart::Ambient,
        ForcePart::Bearing,
        ForcePart::Location,
        ForcePart::Other,
    ];
}

/// Balance of the accelerations of a train at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccelerationBalance {
    forces: SampleForces,
    davis: Davis,
    speed_mps: f64,
    is_held: bool,
}

impl AccelerationBalance {
    pub(super) fn new(forces: SampleForces, davis: Davis, speed_mps: f64) -> Self {
        AccelerationBalance { forces, davis, speed_mps, is_held: false }
    }

    /// Returns the same at another speed in m/s nearby.
    pub(super) fn at(self, speed_mps: f64) -> Self {
        AccelerationBalance { speed_mps, ..self }
    }

    /// Returns the same while a brake that nobody reports holds the train.
    pub(super) fn held(self) -> Self {
        AccelerationBalance { is_held: true, ..self }
    }

    /// Returns the acceleration by the forces in m/s²: negative even where they hold the train at rest.
    #[inline]
    pub(super) fn unheld_mps2(&self) -> f64 {
        let [p0, p1, p2] = self.forces.polynomial(self.davis, self.speed_mps);
        p0 + self.speed_mps * (p1 + self.speed_mps * p2)
    }

    /// dv/dt in m/s²; 0 for a train that is held at rest.
    pub fn acceleration_mps2(&self) -> f64 {
        let free_mps2 = self.unheld_mps2();
        let stays = self.is_held || (self.speed_mps == 0.0 && free_mps2 < 0.0);
        if stays { 0.0 } else { free_mps2 }
    }

    /// Returns the gross mass in kg.
    pub fn mass_kg(&self) -> f64 {
        self.forces.mass_kg
    }

    /// Returns a part in N. On a standing train it is the force that would act.
    pub fn force_n(&self, part: ForcePart) -> f64 {
        let SampleForces { resistance, .. } = &self.forces;
        let (davis, speed_mps) = (self.davis, self.speed_mps);
        let n_per_kn = match part {
            ForcePart::Traction => return self.forces.traction_n,
            ForcePart::Brake => return self.forces.brake_n,
            ForcePart::Gradient => self.forces.gradient_permille,
            ForcePart::Basic => davis.w0_n_per_kn(speed_mps),
            ForcePart::Curve => resistance.curve_n_per_kn,
            ForcePart::Tunnel => resistance.in_tunnels_n_per_kn(davis, speed_mps),
            ForcePart::Wind => resistance.by_wind_n_per_kn(davis, speed_mps),
            ForcePart::Ambient => resistance.by_factor_n_per_kn(davis, speed_mps),
            ForcePart::Bearing => resistance.bearing_n_per_kn,
            ForcePart::Location => resistance.place_n_per_kn,
            ForcePart::Other => resistance.other_at_n_per_kn(speed_mps),
        };
        self.weight_kn() * n_per_kn
    }

    /// Returns all that resists in N but brake and gradient.
    pub fn resistance_n(&self) -> f64 {
        let (davis, speed_mps) = (self.davis, self.speed_mps);
        let extra_n_per_kn = self.forces.resistance.extra_n_per_kn(davis, speed_mps);
        self.weight_kn() * (davis.w0_n_per_kn(speed_mps) + extra_n_per_kn)
    }

    fn weight_kn(&self) -> f64 {
        TrainModel::weight_kn(self.forces.mass_kg)
    }
}
