//! Most likely noise of a model's residuals.

use super::noise::Noise;
use super::run_data::RunData;
use super::whitener::BinWhitener;
use crate::parallel;
use crate::statistics::least_first;

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
