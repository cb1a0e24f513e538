//! The declared model with effects added, as acceleration at each sample.

use dynocar_core::simulate::{ForceModel, QuadraticForces};
use dynocar_core::terms::wheel;
use dynocar_core::train::Davis;

use super::response::Response;
use super::run_data::RunData;
use super::sample_forces::SampleForces;
use crate::explain::hypothesis::SharedHypothesis;

/// The declared model with Davis coefficients and effects as parameters.
#[derive(Clone, Default)]
pub struct GrownModel {
    /// Effects, in the order in which they act on the sample forces.
    pub effects: Vec<SharedHypothesis>,
}

impl GrownModel {
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

    /// True where what each effect does is the same whatever the others do.
    pub fn adds_up(&self) -> bool {
        !self.effects.iter().any(|effect| effect.changes_others())
    }

    /// Some of the effects on the declared forces of a run.
    fn act(
        &self,
        run: &RunData,
        theta: &[f64],
        acts: impl Fn(usize) -> bool,
        forces: &mut GrownForces,
    ) {
        forces.samples.clear();
        forces.samples.extend_from_slice(&run.declared);
        forces.speed_scale = 1.0;
        for is_last in [false, true] {
            let effects = self.effects.iter().zip(self.ranges()).enumerate();
            let turn = |effect: &SharedHypothesis| effect.is_of_the_whole_record() == is_last;
            for (_, (effect, range)) in effects.filter(|it| turn(it.1.0) && acts(it.0)) {
                effect.apply(&theta[range.clone()], run, &mut forces.samples);
                forces.speed_scale *= effect.speed_scale(&theta[range]);
            }
        }
    }

    /// The forces on a run for given parameters; `theta` starts with a, b, c.
    pub fn forces(&self, run: &RunData, theta: &[f64], forces: &mut GrownForces) {
        self.act(run, theta, |_| true, forces);
        let davis = Davis { a: theta[0], b: theta[1], c: theta[2] };
        let scale = forces.speed_scale;
        let samples = forces.samples.iter().zip(&run.smooth_mps);
        let polynomials = samples.map(|(state, &speed_mps)| {
            state.polynomial(davis, wheel::true_speed_mps(speed_mps, scale))
        });
        forces.quadratic.set(polynomials, scale);
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
        self.predict_bins_of(run, theta, |_| true, forces, bins);
    }

    /// The same with some of the effects, by their number.
    pub fn predict_bins_of(
        &self,
        run: &RunData,
        theta: &[f64],
        acts: impl Fn(usize) -> bool,
        forces: &mut GrownForces,
        bins: &mut Vec<f64>,
    ) {
        self.act(run, theta, acts, forces);
        let davis = Davis { a: theta[0], b: theta[1], c: theta[2] };
        let scale = forces.speed_scale;
        let acceleration = |i: usize| {
            let speed_mps = wheel::true_speed_mps(run.smooth_mps[i], scale);
            let [p0, p1, p2] = forces.samples[i].polynomial(davis, speed_mps);
            [scale * (p0 + speed_mps * (p1 + speed_mps * p2))]
        };
        integrate_bins(run, acceleration, [bins]);
    }

    /// What some of the effects make of the bins for every a, b and c.
    pub fn response(
        &self,
        run: &RunData,
        theta: &[f64],
        acts: impl Fn(usize) -> bool,
        forces: &mut GrownForces,
        response: &mut Response,
    ) {
        self.act(run, theta, acts, forces);
        let scale = forces.speed_scale;
        let none = Davis { a: 0.0, b: 0.0, c: 0.0 };
        let accelerations = |i: usize| {
            let speed_mps = wheel::true_speed_mps(run.smooth_mps[i], scale);
            let state = &forces.samples[i];
            let [p0, p1, p2] = state.polynomial(none, speed_mps);
            let [a, b, c] = state.davis_slopes(speed_mps);
            [p0 + speed_mps * (p1 + speed_mps * p2), a, b, c].map(|own| scale * own)
        };
        let Response { rest, davis: [by_a, by_b, by_c] } = response;
        integrate_bins(run, accelerations, [rest, by_a, by_b, by_c]);
    }
}

/// Integrals of accelerations in m/s² over each segment of motion, averaged over the bins.
pub fn integrate_bins<const N: usize>(
    run: &RunData,
    accelerations: impl Fn(usize) -> [f64; N],
    mut bins: [&mut Vec<f64>; N],
) {
    let time_s = run.recording.time_s();
    for bins in &mut bins {
        bins.clear();
        bins.reserve(run.bins.len());
    }
    let mut segment = usize::MAX;
    let (mut gained, mut last_s, mut last) = ([0.0; N], 0.0, [0.0; N]);
    for bin in &run.bins {
        let mut sums = [0.0; N];
        for i in bin.first..bin.end {
            let here = accelerations(i);
            if bin.segment == segment || i > bin.first {
                let half_s = 0.5 * (time_s[i] - last_s);
                for k in 0..N {
                    gained[k] += half_s * (here[k] + last[k]);
                }
            } else {
                gained = [0.0; N];
            }
            (last_s, last) = (time_s[i], here);
            for k in 0..N {
                sums[k] += gained[k];
            }
        }
        segment = bin.segment;
        let count = (bin.end - bin.first) as f64;
        for (bins, sum) in bins.iter_mut().zip(sums) {
            bins.push(sum / count);
        }
    }
}

/// Forces of a grown model over one run; keeps its memory from one evaluation to the next.
#[derive(Clone, Debug, Default)]
pub struct GrownForces {
    samples: Vec<SampleForces>,
    speed_scale: f64,
    quadratic: QuadraticForces,
}

impl GrownForces {
    /// What the bins of the prediction made last change by for a gradient in ‰ along the travel at each
    /// sample.
    pub fn gradient_slopes(&self, run: &RunData, permille: &[f64], bins: &mut Vec<f64>) {
        let slope = |i: usize| [self.speed_scale * self.samples[i].gradient_slope() * permille[i]];
        integrate_bins(run, slope, [bins]);
    }
}

impl ForceModel for GrownForces {
    #[inline]
    fn acceleration_mps2(&self, index: usize, speed_mps: f64) -> f64 {
        self.quadratic.acceleration_mps2(index, speed_mps)
    }

    fn speed_scale(&self) -> f64 {
        self.speed_scale
    }
}
