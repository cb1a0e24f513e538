//! Whitening of the noise, and Huber's loss of what it leaves.

use super::fade::Fade;
use super::noise::Noise;
use super::run_data::RunData;

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
    level_gain: f64,
    fading_gain: f64,
    per_deviation: f64,
}

impl Whitener {
    /// The filter of one run: level of the speed difference and fading acceleration. Each segment
    /// of motion starts with an unknown level; the fading acceleration lives through stops.
    pub fn new(run: &RunData, noise: Noise) -> Self {
        let Noise { white_density, fading_var, fading_s, .. } = noise;
        // Covariance of (level, fading acceleration).
        let (mut pll, mut plf, mut pff) = (0.0, 0.0, fading_var);
        let mut log_determinant = 0.0;
        let mut before: Option<(usize, f64)> = None;
        let mut steps = Vec::with_capacity(run.bins.len());
        let mut by_step = Fade::new(fading_s);
        for bin in &run.bins {
            let measurement_var = noise.bin_var(bin.jump_mps2);
            let step_s = before.map_or(0.0, |(_, time_s)| bin.time_s - time_s);
            let starts = before.is_none_or(|(segment, _)| segment != bin.segment);
            before = Some((bin.segment, bin.time_s));
            let fade = by_step.over(step_s);
            let carry_s = fading_s * (1.0 - fade);
            let gone = 1.0 - fade * fade;
            if starts {
                (pll, plf, pff) = (measurement_var, 0.0, fade * fade * pff + fading_var * gone);
                steps.push(Step {
                    starts,
                    fade,
                    carry_s,
                    level_gain: 1.0,
                    fading_gain: 0.0,
                    per_deviation: 0.0,
                });
                continue;
            }
            let driven = fading_var
                * fading_s
                * fading_s
                * (2.0 * step_s / fading_s - 3.0 + 4.0 * fade - fade * fade);
            let crossed = fading_var * fading_s * (1.0 - fade) * (1.0 - fade);
            let level = pll
                + 2.0 * carry_s * plf
                + carry_s * carry_s * pff
                + white_density * step_s
                + driven.max(0.0);
            let mixed = fade * (plf + carry_s * pff) + crossed;
            let fading = fade * fade * pff + fading_var * gone;
            let variance = level + measurement_var;
            let (level_gain, fading_gain) = (level / variance, mixed / variance);
            pll = level * measurement_var / variance;
            plf = mixed * measurement_var / variance;
            pff = fading - fading_gain * mixed;
            log_determinant += variance.ln();
            let per_deviation = 1.0 / variance.sqrt();
            steps.push(Step { starts, fade, carry_s, level_gain, fading_gain, per_deviation });
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
            level = ahead + step.level_gain * difference;
            fading += step.fading_gain * difference;
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
