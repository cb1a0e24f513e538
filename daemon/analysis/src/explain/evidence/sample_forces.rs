//! Accelerating forces at one sample, and the effects that act on those of a run: in blocks of so few samples that they
//! stay in the processor's cache.

use std::ops::Range;

use dynocar_model::force::{ForceBalance, ResolvedSample, mps2_per_n_per_kn};
use dynocar_model::terms::Resistance;
use dynocar_model::train::Davis;

use super::bins::Bin;
use super::run_data::RunData;
use crate::explain::hypothesis::{On, Past, SharedHypothesis};

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

/// Number of samples of a block.
const BLOCK: usize = 128;

/// All samples of a run, block by block.
pub(super) fn blocks(run: &RunData) -> impl Iterator<Item = Range<usize>> {
    let count = run.samples().len();
    (0..count).step_by(BLOCK).map(move |first| first..(first + BLOCK).min(count))
}

/// Effects of a model with the ranges of their parameters, in the order in which they act.
pub(super) struct Pass<'m> {
    pub order: Vec<(&'m SharedHypothesis, Range<usize>)>,
    /// Whether one of them depends on earlier samples: then no sample may be left out.
    pub looks_back: bool,
}

impl<'m> Pass<'m> {
    /// Returns the pass of effects that are given in the order of the model; sorts them by their turn.
    pub fn of(effects: impl Iterator<Item = (&'m SharedHypothesis, Range<usize>)>) -> Self {
        let mut order: Vec<_> = effects.collect();
        order.sort_by_key(|(effect, _)| effect.nature().turn);
        let looks_back = order.iter().any(|(effect, _)| effect.nature().looks_back);
        Pass { order, looks_back }
    }

    /// The first of some bins that are looked at together with the samples from one on: one at least.
    pub fn bins<'b>(&self, first: usize, bins: &'b [Bin]) -> &'b [Bin] {
        let fits = |bin: &&Bin| bin.end <= first + BLOCK;
        let count = bins.iter().take_while(fits).count();
        &bins[..count.max(1).min(bins.len())]
    }

    /// Acts on the declared forces at some samples of a run.
    pub fn on_declared(
        &self,
        (run, theta): (&RunData, &[f64]),
        samples: Range<usize>,
        acting: &mut Acting,
    ) {
        let first = samples.start;
        acting.declared(run, samples);
        self.act(PassInput { run, theta, first }, 0..self.order.len(), acting, 0);
    }

    /// Lets some of the effects act on the forces so far, at the samples from one on. Their memories start at number
    /// `past`.
    pub fn act(
        &self,
        PassInput { run, theta, first }: PassInput<'_>,
        turns: Range<usize>,
        acting: &mut Acting,
        past: usize,
    ) {
        let Acting { samples, pasts } = acting;
        pasts.resize_with(pasts.len().max(past + self.order.len()), Past::default);
        let own = self.order[turns.clone()].iter().zip(&mut pasts[past + turns.start..]);
        for ((effect, range), past) in own {
            effect.apply(&theta[range.clone()], On { run, first, past }, samples);
        }
    }
}

/// Samples on which effects act, and the parameters with which they do.
#[derive(Clone, Copy, Debug)]
pub(super) struct PassInput<'a> {
    pub run: &'a RunData,
    pub theta: &'a [f64],
    /// Number of the first sample.
    pub first: usize,
}

/// Forces at the newest samples, with the memory that the effects keep of those before.
#[derive(Clone, Debug, Default)]
pub(super) struct Acting {
    pub samples: Vec<SampleForces>,
    pasts: Vec<Past>,
}

impl Acting {
    /// As declared, at some samples of a run.
    pub fn declared(&mut self, run: &RunData, samples: Range<usize>) {
        self.samples.clear();
        self.samples.extend(run.declared.at(samples));
    }
}
