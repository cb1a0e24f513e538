//! What accelerates a train at a sample of a recorded run.

use super::recording::Recording;
use crate::force::ResolvedSample;
use crate::force::balance::ActingForces;
use crate::train::Davis;

/// The acceleration of a train at each sample of a recorded run, for any speed.
///
/// The simulated speed is not the measured one, so a model answers for any speed; everything
/// else (place, forces, weather) is the sample's. Between samples the answers are interpolated.
pub trait ForceModel {
    /// dv/dt in m/s² at the sample of this index if the train went at `speed_mps` there.
    fn acceleration_mps2(&self, index: usize, speed_mps: f64) -> f64;

    /// Measured speed over true speed; differs from 1 where the wheel diameter is not the
    /// declared one.
    fn speed_scale(&self) -> f64 {
        1.0
    }
}

/// A closure (index, speed in m/s) to dv/dt in m/s².
impl<F: Fn(usize, f64) -> f64> ForceModel for F {
    fn acceleration_mps2(&self, index: usize, speed_mps: f64) -> f64 {
        self(index, speed_mps)
    }
}

/// Acceleration in m/s² at one sample as a polynomial of the speed in m/s: p0 + p1 v + p2 v².
pub type Polynomial = [f64; 3];

/// A force model that is a quadratic polynomial of the speed at every sample.
///
/// The declared model is of this form, and so are tunnel and curve resistance, wind, dragging
/// brakes, another mass, gain or delay of the forces: an effect adds its three numbers per sample
/// once, and the simulation costs the same with ten effects as with none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuadraticForces {
    polynomials: Vec<Polynomial>,
    speed_scale: f64,
}

impl QuadraticForces {
    /// The declared model over a run with the given Davis coefficients.
    pub fn declared(recording: &Recording, resistance: Davis) -> Self {
        let mut forces = QuadraticForces::default();
        let polynomial = |sample| declared_polynomial(sample, resistance);
        forces.restart(1.0);
        forces.extend(recording.samples().iter().map(polynomial));
        forces
    }

    /// Becomes the model of no sample yet, and of a measured over true speed; keeps its memory, so that an
    /// optimiser allocates only once.
    pub fn restart(&mut self, speed_scale: f64) {
        self.speed_scale = speed_scale;
        self.polynomials.clear();
    }

    /// Goes on with these polynomials, one for each sample.
    pub fn extend(&mut self, polynomials: impl Iterator<Item = Polynomial>) {
        self.polynomials.extend(polynomials);
    }
}

impl ForceModel for QuadraticForces {
    #[inline]
    fn acceleration_mps2(&self, index: usize, speed_mps: f64) -> f64 {
        let [p0, p1, p2] = self.polynomials[index];
        p0 + speed_mps * (p1 + speed_mps * p2)
    }

    fn speed_scale(&self) -> f64 {
        self.speed_scale
    }
}

/// The declared model at a sample. A gradient that is not known counts as level track;
/// [`Recording::knows_gradient`] says.
pub fn declared_polynomial(sample: &ResolvedSample, resistance: Davis) -> Polynomial {
    let Davis { a, b, c } = resistance;
    let acting = ActingForces {
        mass_kg: sample.mass_kg,
        rotating_mass_factor: sample.rotating_mass_factor(),
        force_n: sample.control_force_n().unwrap_or(0.0),
        gradient_permille: sample.gradient_permille.unwrap_or(0.0),
        resistance_n_per_kn: [sample.extra_n_per_kn + a, b, c],
    };
    acting.acceleration_mps2()
}
