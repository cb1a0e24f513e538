//! The declared model with effects added, as acceleration at each sample.

use dynocar_core::simulate::{ForceModel, QuadraticForces};
use dynocar_core::terms::wheel;
use dynocar_core::train::Davis;

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

    /// The effects on the declared forces of a run.
    fn act(&self, run: &RunData, theta: &[f64], forces: &mut GrownForces) {
        forces.samples.clear();
        forces.samples.extend_from_slice(&run.declared);
        forces.speed_scale = 1.0;
        for is_last in [false, true] {
            let effects = self.effects.iter().zip(self.ranges());
            for (effect, range) in effects.filter(|it| it.0.is_of_the_whole_record() == is_last) {
                effect.apply(&theta[range.clone()], run, &mut forces.samples);
                forces.speed_scale *= effect.speed_scale(&theta[range]);
            }
        }
    }

    /// The forces on a run for given parameters; `theta` starts with a, b, c.
    pub fn forces(&self, run: &RunData, theta: &[f64], forces: &mut GrownForces) {
        self.act(run, theta, forces);
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
        self.act(run, theta, forces);
        let davis = Davis { a: theta[0], b: theta[1], c: theta[2] };
        let scale = forces.speed_scale;
        let acceleration = |i: usize| {
            let speed_mps = wheel::true_speed_mps(run.smooth_mps[i], scale);
            let [p0, p1, p2] = forces.samples[i].polynomial(davis, speed_mps);
            scale * (p0 + speed_mps * (p1 + speed_mps * p2))
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
    speed_scale: f64,
    quadratic: QuadraticForces,
}

impl GrownForces {
    /// What the bins of the prediction made last change by for each unit of a (0), b (1) or c (2).
    pub fn davis_slopes(&self, run: &RunData, coefficient: usize, bins: &mut Vec<f64>) {
        let scale = self.speed_scale;
        let slope = |i: usize| {
            let speed_mps = wheel::true_speed_mps(run.smooth_mps[i], scale);
            scale * self.samples[i].davis_slopes(speed_mps)[coefficient]
        };
        integrate_bins(run, slope, bins);
    }

    /// What they change by for a gradient in ‰ along the travel at each sample.
    pub fn gradient_slopes(&self, run: &RunData, permille: &[f64], bins: &mut Vec<f64>) {
        let slope = |i: usize| self.speed_scale * self.samples[i].gradient_slope() * permille[i];
        integrate_bins(run, slope, bins);
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
