//! The declared model with effects added, as acceleration at each sample.

use std::sync::Arc;

use super::run_data::RunData;
use crate::explain::effects::Hypothesis;
use crate::force::ResolvedSample;
use crate::simulate::ForceModel;
use crate::train::{Davis, TrainModel};

/// An effect with its structure (places, windows, runs) fixed, shared by models.
pub type SharedHypothesis = Arc<dyn Hypothesis>;

/// What accelerates the train at one sample; effects change these fields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleForces {
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
    /// Resistance tied to the place in N/kN, as declared: curves and tunnels.
    pub tied_n_per_kn: f64,
    /// Factor on the basic resistance.
    pub resistance_factor: f64,
    /// Added to c, in N/kN per (m/s)².
    pub c_extra: f64,
    /// Headwind in m/s.
    pub headwind_mps: f64,
    /// Further resistance in N/kN.
    pub extra_n_per_kn: f64,
    /// Further resistance in N.
    pub extra_n: f64,
}

impl SampleForces {
    /// As declared.
    #[inline]
    pub fn declared(sample: &ResolvedSample, rotating_mass_factor: f64) -> Self {
        SampleForces {
            traction_n: sample.traction_force_n.unwrap_or(0.0),
            brake_n: sample.brake_force_n.unwrap_or(0.0),
            mass_factor: 1.0,
            rotating_mass_factor,
            gradient_permille: sample.gradient_permille.unwrap_or(0.0),
            tied_n_per_kn: sample.curve_n_per_kn + sample.tunnel_n_per_kn,
            resistance_factor: 1.0,
            c_extra: 0.0,
            headwind_mps: 0.0,
            extra_n_per_kn: 0.0,
            extra_n: 0.0,
        }
    }

    /// The acceleration p0 + p1 v + p2 v² in m/s² for speeds near `speed_mps`: the air resistance
    /// is c (v + w) |v + w|, whose sign is taken at that speed.
    #[inline]
    fn polynomial(&self, sample: &ResolvedSample, davis: Davis, speed_mps: f64) -> [f64; 3] {
        let per_kg = 1.0 / (sample.mass_kg * self.mass_factor * (1.0 + self.rotating_mass_factor));
        let weight_kn = sample.weight_kn * self.mass_factor;
        let c = davis.c + self.c_extra;
        let wind = self.headwind_mps;
        let air = if speed_mps + wind < 0.0 { -c } else { c };
        let factor = self.resistance_factor * weight_kn * per_kg;
        let other_n_per_kn = self.gradient_permille + self.tied_n_per_kn + self.extra_n_per_kn;
        let force_n = self.traction_n - self.brake_n - self.extra_n;
        [
            per_kg * (force_n - weight_kn * other_n_per_kn)
                - factor * (davis.a + air * wind * wind),
            -factor * (davis.b + 2.0 * air * wind),
            -factor * air,
        ]
    }
}

/// The declared model, Davis coefficients and effects with their parameters.
#[derive(Clone)]
pub struct GrownModel {
    /// Effects, in the order in which they act on the sample forces.
    pub effects: Vec<SharedHypothesis>,
    /// Names of runs that effects speak of.
    pub rotating_mass_factor: f64,
}

impl GrownModel {
    /// The declared model of a train with no effect.
    pub fn declared(train: &TrainModel) -> Self {
        GrownModel { effects: Vec::new(), rotating_mass_factor: train.rotating_mass_factor }
    }

    /// The same with one effect more.
    pub fn with(&self, effect: SharedHypothesis) -> Self {
        let mut grown = self.clone();
        grown.effects.push(effect);
        grown
    }

    /// Number of parameters: a, b, c and those of the effects.
    pub fn parameter_count(&self) -> usize {
        3 + self.effects.iter().map(|effect| effect.parameters().len()).sum::<usize>()
    }

    /// Where the parameters of each effect lie among all.
    pub fn ranges(&self) -> Vec<std::ops::Range<usize>> {
        let mut from = 3;
        self.effects
            .iter()
            .map(|effect| {
                let range = from..from + effect.parameters().len();
                from = range.end;
                range
            })
            .collect()
    }

    /// The forces on a run for given parameters; `theta` starts with a, b, c.
    pub fn forces(&self, run: &RunData, theta: &[f64], forces: &mut GrownForces) {
        let samples = run.samples();
        let davis = Davis { a: theta[0], b: theta[1], c: theta[2] };
        forces.samples.clear();
        forces
            .samples
            .extend(samples.iter().map(|s| SampleForces::declared(s, self.rotating_mass_factor)));
        forces.speed_scale = 1.0;
        for (effect, range) in self.effects.iter().zip(self.ranges()) {
            effect.apply(&theta[range.clone()], run, &mut forces.samples);
            forces.speed_scale *= effect.speed_scale(&theta[range]);
        }
        forces.polynomials.clear();
        let per_scale = 1.0 / forces.speed_scale;
        forces.polynomials.extend(
            forces
                .samples
                .iter()
                .zip(samples)
                .zip(&run.smooth_mps)
                .map(|((state, sample), speed)| state.polynomial(sample, davis, speed * per_scale)),
        );
    }

    /// Modelled measured speed at each bin, each segment starting from zero: the integral of the
    /// acceleration at the measured speed, averaged like the measurements.
    pub fn predict_bins(
        &self,
        run: &RunData,
        theta: &[f64],
        forces: &mut GrownForces,
        bins: &mut Vec<f64>,
    ) {
        self.forces(run, theta, forces);
        let per_scale = 1.0 / forces.speed_scale;
        let acceleration = |i: usize| {
            forces.speed_scale * forces.acceleration_mps2(i, run.smooth_mps[i] * per_scale)
        };
        integrate_bins(run, acceleration, bins);
    }
}

/// Integral of an acceleration in m/s² over each segment of motion, averaged over the bins.
pub fn integrate_bins(run: &RunData, acceleration: impl Fn(usize) -> f64, bins: &mut Vec<f64>) {
    let time_s = run.recording.time_s();
    bins.clear();
    let mut segment = usize::MAX;
    let (mut gained, mut last) = (0.0, (0.0, 0.0));
    for bin in &run.bins {
        let mut sum = 0.0;
        for i in bin.first..bin.end {
            let here = (time_s[i], acceleration(i));
            if bin.segment == segment || i > bin.first {
                gained += 0.5 * (here.0 - last.0) * (here.1 + last.1);
            } else {
                gained = 0.0;
            }
            last = here;
            sum += gained;
        }
        segment = bin.segment;
        bins.push(sum / (bin.end - bin.first) as f64);
    }
}

/// Forces of a grown model over one run; keeps its memory from one evaluation to the next.
#[derive(Clone, Debug, Default)]
pub struct GrownForces {
    samples: Vec<SampleForces>,
    polynomials: Vec<[f64; 3]>,
    speed_scale: f64,
}

impl ForceModel for GrownForces {
    #[inline]
    fn acceleration_mps2(&self, index: usize, speed_mps: f64) -> f64 {
        let [p0, p1, p2] = self.polynomials[index];
        p0 + speed_mps * (p1 + speed_mps * p2)
    }

    fn speed_scale(&self) -> f64 {
        self.speed_scale
    }
}
