//! Whitening of the noise, and Huber's loss of the innovations.

use std::array;
use std::sync::Arc;

use nalgebra::{Matrix2, Vector2};

use super::bins::Bin;
use super::noise::{Fade, Noise, SAME_STEP_S};
use super::run_data::RunData;
use dynocar_core::filter::Gaussian;

/// Indices in the belief: the level of the speed difference in m/s, the fading acceleration in m/s².
pub(super) const LEVEL: usize = 0;
pub(super) const FADING: usize = 1;

/// Innovations beyond this many standard deviations count linearly (Huber).
const HUBER: f64 = 3.0;

/// Huber's loss, twice: the square within the bound.
#[inline]
fn robust_loss(nu: f64) -> f64 {
    let size = nu.abs();
    if size <= HUBER { nu * nu } else { HUBER * (2.0 * size - HUBER) }
}

/// Weight of an innovation in a normal equation.
#[inline]
pub(super) fn robust_weight(nu: f64) -> f64 {
    let size = nu.abs();
    if size <= HUBER { 1.0 } else { HUBER / size }
}

/// Turns bin differences of one run into white innovations of unit variance.
#[derive(Clone, Debug)]
pub struct BinWhitener {
    steps: Arc<[Step]>,
    /// Sum of the logarithms of the innovations' variances.
    log_determinant: f64,
}

/// One step of the filter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    /// Whether a segment of motion starts.
    pub starts: bool,
    /// Share of the fading acceleration that is left.
    pub fade: f64,
    /// By how much it moves the level, per unit.
    pub carry_s: f64,
    /// Gains of the level and the fading acceleration from a difference.
    pub gain: Vector2<f64>,
    /// Innovation by difference.
    pub per_deviation: f64,
}

/// Covariance that an acceleration of unit variance which fades in `fading_s` gains over a step
/// together with the speed that it makes (Ornstein-Uhlenbeck process and its integral).
fn fading_noise(fade: f64, step_s: f64, fading_s: f64) -> Matrix2<f64> {
    let speed = fading_s * fading_s * (2.0 * step_s / fading_s - 3.0 + 4.0 * fade - fade * fade);
    let both = fading_s * (1.0 - fade) * (1.0 - fade);
    Matrix2::new(speed.max(0.0), both, both, 1.0 - fade * fade)
}

/// Variances so near to each other, by their share, are one: the filter has settled.
const SETTLED_SHARE: f64 = 1e-14;

/// The filter on its way over the bins of a run.
struct Walk {
    noise: Noise,
    belief: Gaussian<2>,
    before: Option<(usize, f64)>,
    by_step: Fade,
    /// The step made last within a segment.
    last: Option<Settling>,
    /// Whether the belief is the result of this step.
    follows: bool,
}

/// A step from one belief to the next, remembered because the same step from the same belief has the same result.
#[derive(Clone, Copy)]
struct Settling {
    time_s: f64,
    bin_var: f64,
    from: Matrix2<f64>,
    to: Matrix2<f64>,
    step: Step,
    variance: f64,
    /// Whether it leads to where it comes from.
    is_settled: bool,
}

impl Settling {
    fn is_of(&self, time_s: f64, bin_var: f64) -> bool {
        self.bin_var == bin_var && (self.time_s - time_s).abs() <= SAME_STEP_S
    }
}

/// Returns whether two beliefs differ by so little that they count as one.
fn is_converged(from: &Matrix2<f64>, now: &Matrix2<f64>) -> bool {
    let is_near = |one: f64, other: f64| (one - other).abs() <= SETTLED_SHARE * other.abs();
    from.iter().zip(now.iter()).all(|(from, now)| is_near(*from, *now))
}

impl Walk {
    fn new(noise: Noise) -> Self {
        let std = Vector2::new(0.0, noise.fading_var.sqrt());
        let belief = Gaussian::<2>::independent(Vector2::zeros(), std);
        let by_step = Fade::new(noise.fading_s);
        Walk { noise, belief, before: None, by_step, last: None, follows: false }
    }

    /// Returns the step to the next bin and the variance of the innovation there, 1 if there is no next bin.
    #[inline]
    fn step(&mut self, bin: &Bin) -> (Step, f64) {
        let Noise { fading_var, fading_s, .. } = self.noise;
        let bin_var = self.noise.bin_var(bin);
        let step_s = self.before.map_or(0.0, |(_, time_s)| bin.time_s - time_s);
        let starts = self.before.is_none_or(|(segment, _)| segment != bin.segment);
        self.before = Some((bin.segment, bin.time_s));
        let belief = &mut self.belief;
        let follows = std::mem::replace(&mut self.follows, !starts);
        if let Some(last) = &self.last
            && !starts
            && last.is_of(step_s, bin_var)
            && (if follows {
                last.is_settled
            } else {
                is_converged(&last.from, &belief.covariance)
            })
        {
            belief.covariance = last.to;
            return (last.step, last.variance);
        }
        let fade = self.by_step.over(step_s);
        let carry_s = fading_s * (1.0 - fade);
        let mut step =
            Step { starts, fade, carry_s, gain: Vector2::new(1.0, 0.0), per_deviation: 0.0 };
        if starts {
            belief.fade(FADING, fade, fading_var * (1.0 - fade * fade));
            belief.replace(LEVEL, 0.0, bin_var);
            return (step, 1.0);
        }
        let from = belief.covariance;
        let moved = Matrix2::new(1.0, carry_s, 0.0, fade);
        let added = fading_var * fading_noise(fade, step_s, fading_s);
        let white = Matrix2::new(self.noise.white_density * step_s, 0.0, 0.0, 0.0);
        belief.predict(Vector2::zeros(), &moved, &(added + white));
        // Without mean and observation only the variances are known.
        let Ok(innovation) = belief.innovation(LEVEL, 0.0, bin_var) else {
            self.follows = false;
            return (step, 1.0);
        };
        step.gain = belief.take(LEVEL, &innovation, bin_var);
        step.per_deviation = innovation.inverse_variance.sqrt();
        let (to, variance) = (belief.covariance, innovation.variance);
        let is_settled = is_converged(&from, &to);
        self.last =
            Some(Settling { time_s: step_s, bin_var, from, to, step, variance, is_settled });
        (step, variance)
    }
}

/// A sum of logarithms, taken of products.
struct LogSum {
    sum: f64,
    product: f64,
}

impl LogSum {
    const NOTHING: LogSum = LogSum { sum: 0.0, product: 1.0 };
    /// A product outside these bounds is added as a logarithm: a variance above 1e-30 may still multiply it within the
    /// range of `f64`.
    const CLOSED: [f64; 2] = [1e-200, 1e200];

    #[inline]
    fn add(&mut self, value: f64) {
        self.product *= value;
        if !(Self::CLOSED[0]..Self::CLOSED[1]).contains(&self.product) {
            self.sum += self.product.ln();
            self.product = 1.0;
        }
    }

    fn total(&self) -> f64 {
        self.sum + self.product.ln()
    }
}

/// The level of the speed difference and the fading acceleration at a bin.
#[derive(Default)]
struct Tracked {
    level: f64,
    fading: f64,
}

impl Tracked {
    /// The innovation of the next difference.
    #[inline]
    fn innovation(&mut self, step: &Step, value: f64) -> f64 {
        let ahead = if step.starts { value } else { self.level + step.carry_s * self.fading };
        let difference = value - ahead;
        self.level = ahead + step.gain[LEVEL] * difference;
        self.fading = self.fading * step.fade + step.gain[FADING] * difference;
        difference * step.per_deviation
    }
}

impl BinWhitener {
    /// The filter of one run: level of the speed difference and fading acceleration. Each segment
    /// of motion starts with an unknown level; the fading acceleration lives through stops.
    pub fn new(run: &RunData, noise: Noise) -> Self {
        let (mut walk, mut logarithms) = (Walk::new(noise), LogSum::NOTHING);
        let step = |bin| {
            let (step, variance) = walk.step(bin);
            logarithms.add(variance);
            step
        };
        let steps = run.bins.iter().map(step).collect();
        BinWhitener { steps, log_determinant: logarithms.total() }
    }

    /// Robust -2 log likelihood of a series of bin differences under a noise, up to a constant.
    pub fn cost(run: &RunData, noise: Noise, series: &[f64]) -> f64 {
        let (mut walk, mut logarithms) = (Walk::new(noise), LogSum::NOTHING);
        let (mut tracked, mut loss) = (Tracked::default(), 0.0);
        for (bin, &value) in run.bins.iter().zip(series) {
            let (step, variance) = walk.step(bin);
            logarithms.add(variance);
            loss += robust_loss(tracked.innovation(&step, value));
        }
        logarithms.total() + loss
    }

    /// Innovations of a series of bin differences; 0 where a segment starts.
    pub fn whiten(&self, series: &[f64], innovations: &mut Vec<f64>) {
        innovations.clear();
        let mut tracked = Tracked::default();
        let steps = self.steps.iter().zip(series);
        innovations.extend(steps.map(|(step, &value)| tracked.innovation(step, value)));
    }

    /// Puts in the place of some series their innovations; those that are empty stay.
    pub fn whiten_all(&self, series: &mut [Vec<f64>]) {
        let mut left: Vec<&mut [f64]> =
            series.iter_mut().filter(|it| !it.is_empty()).map(|it| &mut it[..]).collect();
        let mut left = &mut left[..];
        loop {
            left = match left {
                [a, b, c, d, left @ ..] => {
                    self.whiten_together([a, b, c, d]);
                    left
                }
                [a, b, left @ ..] => {
                    self.whiten_together([a, b]);
                    left
                }
                [a, left @ ..] => {
                    self.whiten_together([a]);
                    left
                }
                [] => break,
            };
        }
    }

    /// Puts in the place of a few series their innovations, in one loop: no series waits for another.
    fn whiten_together<const N: usize>(&self, series: [&mut [f64]; N]) {
        let mut series = series.map(|it| &mut it[..self.steps.len()]);
        let mut tracked: [Tracked; N] = array::from_fn(|_| Tracked::default());
        for (k, step) in self.steps.iter().enumerate() {
            for (tracked, series) in tracked.iter_mut().zip(&mut series) {
                series[k] = tracked.innovation(step, series[k]);
            }
        }
    }

    /// The steps of the filter.
    pub(super) fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Robust -2 log likelihood of the innovations, up to a constant.
    pub fn minus_two_log_likelihood(&self, innovations: &[f64]) -> f64 {
        self.log_determinant + innovations.iter().map(|&nu| robust_loss(nu)).sum::<f64>()
    }

    /// Innovations that carry information.
    pub fn count(&self) -> usize {
        self.steps.iter().filter(|step| !step.starts).count()
    }
}
