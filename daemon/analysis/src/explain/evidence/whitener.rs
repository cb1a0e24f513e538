//! Whitening of the noise, and Huber's loss of what it leaves.

use nalgebra::{Matrix2, Vector2};

use super::fade::Fade;
use super::noise::Noise;
use super::run_data::RunData;
use dynocar_core::filter::Gaussian;

/// Places in the belief: the level of the speed difference in m/s, the fading acceleration in m/s².
const LEVEL: usize = 0;
const FADING: usize = 1;

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
pub struct Whitener {
    steps: Vec<Step>,
    /// Sum of the logarithms of the innovations' variances.
    log_determinant: f64,
}

#[derive(Clone, Copy, Debug)]
struct Step {
    starts: bool,
    fade: f64,
    carry_s: f64,
    /// What the level and the fading acceleration take of an innovation.
    gain: Vector2<f64>,
    per_deviation: f64,
}

/// Covariance that an acceleration of unit variance which fades in `fading_s` gains over a step
/// together with the speed that it makes (Ornstein-Uhlenbeck process and its integral).
fn fading_noise(fade: f64, step_s: f64, fading_s: f64) -> Matrix2<f64> {
    let speed = fading_s * fading_s * (2.0 * step_s / fading_s - 3.0 + 4.0 * fade - fade * fade);
    let both = fading_s * (1.0 - fade) * (1.0 - fade);
    Matrix2::new(speed.max(0.0), both, both, 1.0 - fade * fade)
}

impl Whitener {
    /// The filter of one run: level of the speed difference and fading acceleration. Each segment
    /// of motion starts with an unknown level; the fading acceleration lives through stops.
    pub fn new(run: &RunData, noise: Noise) -> Self {
        let Noise { white_density, fading_var, fading_s, .. } = noise;
        let mut belief =
            Gaussian::<2>::independent(Vector2::zeros(), Vector2::new(0.0, fading_var.sqrt()));
        let mut log_determinant = 0.0;
        let mut before: Option<(usize, f64)> = None;
        let mut steps = Vec::with_capacity(run.bins.len());
        let mut by_step = Fade::new(fading_s);
        for bin in &run.bins {
            let bin_var = noise.bin_var(bin.jump_mps2);
            let step_s = before.map_or(0.0, |(_, time_s)| bin.time_s - time_s);
            let starts = before.is_none_or(|(segment, _)| segment != bin.segment);
            before = Some((bin.segment, bin.time_s));
            let fade = by_step.over(step_s);
            let carry_s = fading_s * (1.0 - fade);
            let mut step =
                Step { starts, fade, carry_s, gain: Vector2::new(1.0, 0.0), per_deviation: 0.0 };
            if starts {
                belief.fade(FADING, fade, fading_var * (1.0 - fade * fade));
                belief.replace(LEVEL, 0.0, bin_var);
            } else {
                let moved = Matrix2::new(1.0, carry_s, 0.0, fade);
                let added = fading_var * fading_noise(fade, step_s, fading_s);
                let white = Matrix2::new(white_density * step_s, 0.0, 0.0, 0.0);
                belief.predict(Vector2::zeros(), &moved, &(added + white));
                // Without mean and observation only the variances are told.
                if let Ok(innovation) = belief.innovation(LEVEL, 0.0, bin_var) {
                    step.gain = belief.take(LEVEL, &innovation, bin_var);
                    step.per_deviation = innovation.inverse_variance.sqrt();
                    log_determinant += innovation.variance.ln();
                }
            }
            steps.push(step);
        }
        Whitener { steps, log_determinant }
    }

    /// Innovations of a series of bin differences; 0 where a segment starts.
    pub fn whiten(&self, series: &[f64], innovations: &mut Vec<f64>) {
        self.whiten_from(0, series, innovations);
    }

    /// Innovations of a series that is zero before bin number `first` and starts there.
    pub fn whiten_from(&self, first: usize, series: &[f64], innovations: &mut Vec<f64>) {
        innovations.clear();
        let (mut level, mut fading) = (0.0, 0.0);
        for (step, &value) in self.steps[first..].iter().zip(series) {
            let ahead = if step.starts { value } else { level + step.carry_s * fading };
            fading *= step.fade;
            let difference = value - ahead;
            innovations.push(difference * step.per_deviation);
            level = ahead + step.gain[LEVEL] * difference;
            fading += step.gain[FADING] * difference;
        }
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
