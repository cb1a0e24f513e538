//! Accelerating forces at one sample.

use std::ops::Range;

use dynocar_model::force::{ForceBalance, ResolvedSample, mps2_per_n_per_kn};
use dynocar_model::terms::Resistance;
use dynocar_model::train::Davis;

/// Accelerating forces at one sample, which effects change.
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
    /// Resistances, part by part, without a, b and c.
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

    /// The acceleration p0 + p1 v + p2 v² in m/s² for speeds near `speed_mps`.
    #[inline]
    pub fn polynomial(&self, davis: Davis, speed_mps: f64) -> [f64; 3] {
        let acting = ForceBalance {
            mass_kg: self.mass_kg * self.mass_factor,
            rotating_mass_factor: self.rotating_mass_factor,
            force_n: self.traction_n - self.brake_n - self.extra_n,
            gradient_permille: self.gradient_permille,
            resistance_n_per_kn: self.resistance.polynomial(davis, speed_mps),
        };
        acting.acceleration_mps2()
    }

    /// Returns the change of the acceleration by each ‰ of gradient along the travel.
    #[inline]
    pub(super) fn gradient_slope(&self) -> f64 {
        -mps2_per_n_per_kn(self.rotating_mass_factor)
    }

    /// Returns the change of the acceleration by each unit of a, b and c.
    #[inline]
    pub(super) fn davis_slopes(&self, speed_mps: f64) -> [f64; 3] {
        let unit = mps2_per_n_per_kn(self.rotating_mass_factor);
        self.resistance.davis_slopes(speed_mps).map(|slope| -unit * slope)
    }
}

/// Declared forces at the samples of a run: three times smaller than the forces themselves, since all fits read
/// them again and again.
#[derive(Clone, Debug)]
pub struct DeclaredForces {
    rotating_mass_factor: f64,
    samples: Vec<DeclaredSample>,
    /// Resistances, once where consecutive samples have the same.
    resistances: Vec<Resistance>,
}

#[derive(Clone, Copy, Debug)]
struct DeclaredSample {
    mass_kg: f64,
    traction_n: f64,
    brake_n: f64,
    gradient_permille: f64,
    resistance: usize,
}

impl DeclaredForces {
    /// Of some samples of a train.
    pub fn of(samples: &[ResolvedSample], rotating_mass_factor: f64) -> Self {
        let mut resistances: Vec<Resistance> = Vec::new();
        let samples = samples.iter().map(|sample| {
            let SampleForces {
                mass_kg, traction_n, brake_n, gradient_permille, resistance, ..
            } = SampleForces::declared(sample, rotating_mass_factor);
            if resistances.last() != Some(&resistance) {
                resistances.push(resistance);
            }
            let resistance = resistances.len() - 1;
            DeclaredSample { mass_kg, traction_n, brake_n, gradient_permille, resistance }
        });
        let samples = samples.collect();
        resistances.shrink_to_fit();
        DeclaredForces { rotating_mass_factor, samples, resistances }
    }

    /// Returns the forces at some samples, in order.
    #[inline]
    pub fn at(&self, samples: Range<usize>) -> impl ExactSizeIterator<Item = SampleForces> + '_ {
        self.samples[samples].iter().map(|sample| SampleForces {
            mass_kg: sample.mass_kg,
            traction_n: sample.traction_n,
            brake_n: sample.brake_n,
            mass_factor: 1.0,
            rotating_mass_factor: self.rotating_mass_factor,
            gradient_permille: sample.gradient_permille,
            resistance: self.resistances[sample.resistance],
            extra_n: 0.0,
        })
    }

    /// Returns the forces at all samples.
    pub fn all(&self) -> impl ExactSizeIterator<Item = SampleForces> + '_ {
        self.at(0..self.samples.len())
    }

    /// Returns the forces at one sample; `None` behind the last.
    pub fn get(&self, index: usize) -> Option<SampleForces> {
        (index < self.samples.len()).then(|| self.at(index..index + 1).next())?
    }
}

#[cfg(test)]
pub mod test_runs {
    use std::sync::Arc;

    use dynocar_model::force::{ForceResolver, ResolvedSample, ValidSample};
    use dynocar_model::train::{Davis, TrainModel};
    use dynocar_shared::{SampleField, TrainSample};

    use crate::dataset::DATASET_TRAIN;

    /// A train of 100 t with gamma 0.06 that coasts on the level at 20 m/s.
    pub fn coasting() -> ResolvedSample {
        let bare = TrainModel::bare("test", 100e3, Davis { a: 0.0, b: 0.0, c: 0.0 });
        let train = TrainModel { rotating_mass_factor: 0.06, ..bare };
        let mut sample = TrainSample::empty(DATASET_TRAIN);
        for (field, value) in [
            (SampleField::Speed, 20.0),
            (SampleField::TractionForce, 0.0),
            (SampleField::BrakeForce, 0.0),
            (SampleField::Gradient, 0.0),
        ] {
            sample.set(field, value);
        }
        let valid = ValidSample { sample: &sample, step_s: 0.0, segment: 1 };
        ForceResolver::new(Arc::new(train), None).resolve(&valid)
    }
}
