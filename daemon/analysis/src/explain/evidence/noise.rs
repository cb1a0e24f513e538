//! Random process that remains when the model is right, and its most likely values for a model's residuals.

use super::run_data::RunData;
use super::whitener::BinWhitener;
use crate::parallel;
use crate::statistics::least_first;

/// Shares of the slow part of a noise under which a kind is tried again.
const STIFF_SHARES: [f64; 2] = [0.01, 1e-4];
/// Least variance in (m/s²)² of a fading force.
const FADING_VAR_MIN: f64 = 1e-10;

/// Noise of the bins: white measurement noise, a white force, and a force that fades with a time constant
/// (Ornstein-Uhlenbeck), such as gusts or a rough map leave. Where the control force changes, the car with the speed
/// sensor moves against the others on its couplings, which adds measurement noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Variance in (m/s)² of a bin's mean speed.
    pub measurement_var: f64,
    /// Further standard deviation in m/s for each m/s² by which the acceleration of the control
    /// force changed of late, in s.
    pub jump_s: f64,
    /// Spectral density in (m/s)²/s of the white acceleration.
    pub white_density: f64,
    /// Variance in (m/s²)² of the fading acceleration.
    pub fading_var: f64,
    /// Its time constant in s.
    pub fading_s: f64,
    /// Differences from run to run.
    pub scatter: RunScatter,
    /// Upper limit of these differences.
    pub scatter_most: RunScatter,
}

impl Noise {
    /// Where an estimation starts.
    pub const START: Noise = Noise {
        measurement_var: 1e-4,
        jump_s: 0.0,
        white_density: 1e-6,
        fading_var: 1e-5,
        fading_s: 20.0,
        scatter: RunScatter::USUAL,
        scatter_most: RunScatter::MOST,
    };

    /// Returns the noise with a small and with a smaller share of the fading force only: under it a lasting force
    /// counts in full, while a noise that was estimated in the presence of an undeclared force takes that force for
    /// noise. Returns only one where the smaller is no less.
    pub fn stiffer(self) -> Vec<Noise> {
        let stiff = |share: f64| Noise {
            fading_var: (share * self.fading_var).max(FADING_VAR_MIN),
            ..self
        };
        let mut both: Vec<Noise> = STIFF_SHARES.map(stiff).into();
        both.dedup();
        both
    }

    /// Returns the standard deviation in m/s² of the mean acceleration by the force over some seconds.
    pub fn mean_acceleration_mps2(&self, over_s: f64) -> f64 {
        let Noise { white_density, fading_var, fading_s, .. } = *self;
        let lasting_s = over_s - fading_s * (1.0 - (-over_s / fading_s).exp());
        (white_density * over_s + 2.0 * fading_var * fading_s * lasting_s).sqrt() / over_s
    }

    /// Variance in (m/s)² of the mean speed of a bin before which the control force changed by an
    /// acceleration.
    #[inline]
    pub(super) fn bin_var(&self, jump_mps2: f64) -> f64 {
        let of_jump_mps = self.jump_s * jump_mps2;
        self.measurement_var + of_jump_mps * of_jump_mps
    }

    pub(super) fn to_logs(self) -> [f64; 4] {
        [self.measurement_var, self.white_density, self.fading_var, self.fading_s].map(f64::ln)
    }

    pub(super) fn with_logs(self, logs: [f64; 4]) -> Self {
        let bounded = |value: f64, low: f64, high: f64| value.exp().clamp(low, high);
        Noise {
            measurement_var: bounded(logs[0], 1e-8, 1.0),
            // No model is good to 0.01 N/kN in every second; where nearly nothing is left, all would count.
            white_density: bounded(logs[1], 1e-8, 1e-2),
            fading_var: bounded(logs[2], 1e-10, 1e-2),
            fading_s: bounded(logs[3], 4.0, 400.0),
            ..self
        }
    }
}

/// Standard deviations of the runs' own factors; that of the delays is fixed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunScatter {
    /// Of the factor on the control force.
    pub force: f64,
    /// Of the factor on the basic resistance.
    pub resistance: f64,
    /// Of the headwind in m/s.
    pub wind_mps: f64,
}

impl RunScatter {
    /// Differences of well-kept force sensors and ordinary weather.
    pub const USUAL: RunScatter = RunScatter { force: 0.003, resistance: 0.012, wind_mps: 0.01 };
}

/// Candidates of the noise at changes of the control force, in s.
const JUMPS_S: [f64; 6] = [0.0, 0.03, 0.1, 0.3, 1.0, 3.0];
/// Number of runs that one thread takes at a time: fewer are not worth handing out.
pub const RUNS_A_TASK: usize = 8;
/// Largest number of runs with which a search starts.
const COARSE_RUNS_MAX: usize = 32;
/// Width of a search in logarithms of the noise: around a start, and around the result for some of the runs.
const FAR: f64 = 1.2;
const NEAR: f64 = 0.1;

/// Returns the step with which the runs are thinned, evenly, at the start of a search.
pub fn coarse_step(runs: usize) -> usize {
    runs.div_ceil(COARSE_RUNS_MAX).max(1)
}

impl Noise {
    /// The noise under which the differences of the fit runs from a model are likeliest, robust
    /// to outliers. `residuals` holds one vector of bin differences per run.
    pub fn estimate(runs: &[RunData], residuals: &[Vec<f64>], start: Noise) -> Noise {
        let step = coarse_step(runs.len());
        let some = |noise: Noise| cost_of((runs, residuals), step, noise);
        let cost = |noise: Noise| cost_of((runs, residuals), 1, noise);
        let near = if step > 1 { (likeliest((start, FAR), &some), NEAR) } else { (start, FAR) };
        let smooth = likeliest(near, &cost);
        let with = |jump_s: &f64| Noise { jump_s: *jump_s, ..smooth };
        let ragged = JUMPS_S.iter().map(with).map(|noise| (noise, cost(noise)));
        let best = ragged.min_by(|one, other| one.1.total_cmp(&other.1));
        match best {
            Some((noise, _)) if noise.jump_s != smooth.jump_s => likeliest((noise, FAR), &cost),
            _ => smooth,
        }
    }
}

/// The cost of the differences under a noise, of one run in `step`.
fn cost_of((runs, residuals): (&[RunData], &[Vec<f64>]), step: usize, noise: Noise) -> f64 {
    let costs = parallel::in_tasks(runs.len().div_ceil(step), RUNS_A_TASK, |k| {
        BinWhitener::cost(&runs[k * step], noise, &residuals[k * step])
    });
    costs.iter().sum()
}

/// The likeliest noise with the jumps of `start`, looked for so far around its logarithms.
fn likeliest((start, around): (Noise, f64), cost: &impl Fn(Noise) -> f64) -> Noise {
    let bounded_cost = |logs: [f64; 4]| {
        let noise = start.with_logs(logs);
        let kept = noise.to_logs();
        let outside: f64 =
            logs.iter().zip(kept).map(|(log, kept)| (log - kept) * (log - kept)).sum();
        10.0 * outside + cost(noise)
    };
    start.with_logs(nelder_mead((start.to_logs(), around), &bounded_cost))
}

/// Nelder and Mead's simplex search in four dimensions, bounded work.
fn nelder_mead((start, around): ([f64; 4], f64), cost: &impl Fn([f64; 4]) -> f64) -> [f64; 4] {
    const STEPS: usize = 90;
    let mut simplex: Vec<([f64; 4], f64)> = (0..5)
        .map(|vertex| {
            let mut point = start;
            if vertex > 0 {
                point[vertex - 1] += around;
            }
            (point, cost(point))
        })
        .collect();
    let along = |centre: &[f64; 4], worst: &[f64; 4], by: f64| {
        std::array::from_fn(|i| centre[i] + by * (worst[i] - centre[i]))
    };
    for _ in 0..STEPS {
        least_first(&mut simplex, |it| it.1);
        if simplex[4].1 - simplex[0].1 < 0.05 {
            break;
        }
        let centre: [f64; 4] =
            std::array::from_fn(|i| simplex[..4].iter().map(|v| v.0[i]).sum::<f64>() / 4.0);
        let worst = simplex[4];
        let attempt = |by: f64| {
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
    least_first(&mut simplex, |it| it.1);
    simplex[0].0
}

/// Greatest difference in s of steps that count as equal: recorded times are rounded.
pub(super) const SAME_STEP_S: f64 = 1e-9;

/// Share exp(-step / time) that remains after each step; it is computed again only where the step changes, since nearly
/// all steps of a recording are equal.
#[derive(Clone, Copy, Debug)]
pub struct Fade {
    time_s: f64,
    step_s: f64,
    share: f64,
}

impl Fade {
    /// Returns a fade with a time constant in s.
    pub fn new(time_s: f64) -> Self {
        Fade { time_s, step_s: 0.0, share: 1.0 }
    }

    /// Returns the share that remains after a step in s.
    #[inline]
    pub fn over(&mut self, step_s: f64) -> f64 {
        if (step_s - self.step_s).abs() > SAME_STEP_S {
            (self.step_s, self.share) = (step_s, (-step_s / self.time_s).exp());
        }
        self.share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_follows_the_step() {
        let mut fade = Fade::new(4.0);
        for step_s in [0.0, 2.0, 2.0 + 1e-12, 8.0, 2.0] {
            assert!((fade.over(step_s) - (-step_s / 4.0f64).exp()).abs() < 1e-9, "{step_s}");
        }
    }
}
