//! The process that is left when the model is right, and its whitening.

use super::fade::Fade;
use super::run_data::RunData;
use super::run_scatter::RunScatter;

/// Noise of the bins: white measurement noise, a white force, and a force that fades with a time
/// constant (Ornstein-Uhlenbeck), as gusts or a rough map leave it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Variance in (m/s)² of a bin's mean speed.
    pub measurement_var: f64,
    /// Spectral density in (m/s)²/s of the white acceleration.
    pub white_density: f64,
    /// Variance in (m/s²)² of the fading acceleration.
    pub fading_var: f64,
    /// Its time constant in s.
    pub fading_s: f64,
    /// What differs from run to run.
    pub scatter: RunScatter,
}

impl Noise {
    /// Where an estimation starts.
    pub const START: Noise = Noise {
        measurement_var: 1e-4,
        white_density: 1e-6,
        fading_var: 1e-5,
        fading_s: 20.0,
        scatter: RunScatter::USUAL,
    };

    /// The same with a share of the fading force only: under it a lasting force counts in full, which a
    /// noise estimated beside an undeclared force takes for noise.
    pub fn stiff(self, share: f64) -> Noise {
        Noise { fading_var: (share * self.fading_var).max(1e-10), ..self }
    }

    fn to_logs(self) -> [f64; 4] {
        [self.measurement_var, self.white_density, self.fading_var, self.fading_s].map(f64::ln)
    }

    fn from_logs(logs: [f64; 4], scatter: RunScatter) -> Self {
        let bounded = |value: f64, low: f64, high: f64| value.exp().clamp(low, high);
        Noise {
            measurement_var: bounded(logs[0], 1e-8, 1.0),
            white_density: bounded(logs[1], 1e-9, 1e-2),
            fading_var: bounded(logs[2], 1e-10, 1e-2),
            fading_s: bounded(logs[3], 4.0, 400.0),
            scatter,
        }
    }

    /// The noise under which the differences of the fit runs from a model are likeliest, robust
    /// to outliers. `residuals` holds one vector of bin differences per run.
    pub fn estimate(runs: &[RunData], residuals: &[Vec<f64>], start: Noise) -> Noise {
        let mut whitened = Vec::new();
        let mut cost = |logs: [f64; 4]| -> f64 {
            let noise = Noise::from_logs(logs, start.scatter);
            let outside: f64 = logs
                .iter()
                .zip(noise.to_logs())
                .map(|(log, kept)| (log - kept) * (log - kept))
                .sum();
            let mut total = 10.0 * outside;
            for (run, residual) in runs.iter().zip(residuals) {
                let whitener = Whitener::new(run, noise);
                whitener.whiten(residual, &mut whitened);
                total += whitener.minus_two_log_likelihood(&whitened);
            }
            total
        };
        Noise::from_logs(nelder_mead(start.to_logs(), &mut cost), start.scatter)
    }
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
        let Noise { measurement_var, white_density, fading_var, fading_s, .. } = noise;
        // Covariance of (level, fading acceleration).
        let (mut pll, mut plf, mut pff) = (0.0, 0.0, fading_var);
        let mut log_determinant = 0.0;
        let mut before: Option<(usize, f64)> = None;
        let mut steps = Vec::with_capacity(run.bins.len());
        let mut by_step = Fade::new(fading_s);
        for bin in &run.bins {
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
        self.log_determinant
            + innovations.iter().map(|&nu| super::fit::robust_loss(nu)).sum::<f64>()
    }

    /// Innovations that carry information.
    pub fn count(&self) -> usize {
        self.steps.iter().filter(|step| !step.starts).count()
    }
}

/// Nelder and Mead's simplex search in four dimensions, bounded work.
fn nelder_mead(start: [f64; 4], cost: &mut impl FnMut([f64; 4]) -> f64) -> [f64; 4] {
    const STEPS: usize = 90;
    let mut simplex: Vec<([f64; 4], f64)> = (0..5)
        .map(|vertex| {
            let mut point = start;
            if vertex > 0 {
                point[vertex - 1] += 1.2;
            }
            (point, cost(point))
        })
        .collect();
    let along = |centre: &[f64; 4], worst: &[f64; 4], by: f64| {
        std::array::from_fn(|i| centre[i] + by * (worst[i] - centre[i]))
    };
    for _ in 0..STEPS {
        simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
        if simplex[4].1 - simplex[0].1 < 0.05 {
            break;
        }
        let centre: [f64; 4] =
            std::array::from_fn(|i| simplex[..4].iter().map(|v| v.0[i]).sum::<f64>() / 4.0);
        let worst = simplex[4];
        let mut attempt = |by: f64| {
            let point = along(&centre, &worst.0, by);
            (point, cost(point))
        };
        let reflected = attempt(-1.0);
        if reflected.1 < simplex[0].1 {
            let expanded = attempt(-2.0);
            simplex[4] = if expanded.1 < reflected.1 { expanded } else { reflected };
        } else if reflected.1 < simplex[3].1 {
            simplex[4] = reflected;
        } else {
            let contracted = attempt(0.5);
            if contracted.1 < worst.1 {
                simplex[4] = contracted;
            } else {
                let best = simplex[0].0;
                for vertex in &mut simplex[1..] {
                    let point = along(&best, &vertex.0, 0.5);
                    *vertex = (point, cost(point));
                }
            }
        }
    }
    simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
    simplex[0].0
}
