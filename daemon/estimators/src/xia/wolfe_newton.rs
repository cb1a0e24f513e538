//! Newton's method with Wolfe steps at the bounds and random restarts: Algorithm 1 of Xia 2023.
//!
//! The paper's algorithm is kept as it is, weaknesses included, as the yardstick for [`crate::xia::trajectory::fit`]:
//! the Hessian is positive definite at none (cruise) to a fifth (full speed profile) of random parameters, so that eq.
//! 10 often climbs; v_0 is the first measured speed with its noise; restarts are a lottery. Where the paper leaves a
//! choice:
//!
//! - step 11 as printed restarts after every iteration that has not converged, which no search
//!   survives; as in the text, this one restarts when the parameters no longer move;
//! - the stall test |θ_{n+1} - θ_n| < Δθ_T is taken per component, in absolute values;
//! - α in eq. 24 is halved from 1; if 30 halvings find none, the iteration counts as stalled;
//! - a train that stops (v² < 0 in eq. 7) counts as a stall;
//! - when the iterations run out, the best parameters seen are the answer.

use dynocar_core::filter::levenberg_marquardt::ParameterBox;
use dynocar_core::filter::random::split_mix;
use dynocar_model::train::Davis;
use nalgebra::Vector3;

use super::window::{Deviation, deviation};
use crate::xia::trajectory::step::TrajectoryStep;

/// When Algorithm 1 draws new parameters at random.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Restarts {
    /// Never; the search ends where it stalls.
    Never,
    /// When the parameters no longer move: the text below eq. 25.
    WhenStalled,
}

/// Table 2 of Xia 2023.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonSettings {
    /// Θ, the bounds of (a, b, c).
    pub bounds: ParameterBox<3>,
    /// N, the most iterations.
    pub iterations_max: u32,
    /// c1 of eq. 24: share of the promised decrease that a step must reach.
    pub decrease_share: f64,
    /// c2 of eq. 24: share of the slope that may remain after a step.
    pub slope_share: f64,
    /// ε1 of eq. 25 in (m/s)²: a smaller mean square ends the search.
    pub mean_square_max: f64,
    /// Δθ_T: smaller steps in every component are a stall.
    pub step_min: Vector3<f64>,
    /// Least distance of a restart from where the search stalled, in every component.
    pub restart_distance: Vector3<f64>,
    /// When to restart.
    pub restarts: Restarts,
}

impl NewtonSettings {
    /// Returns the values of Table 2; restarts as the text has them.
    pub fn of_the_paper() -> Self {
        NewtonSettings {
            bounds: ParameterBox {
                low: Vector3::new(0.4, 0.0, 0.0),
                high: Vector3::new(3.0, 0.2, 0.01),
            },
            iterations_max: 100,
            decrease_share: 0.1,
            slope_share: 0.9,
            mean_square_max: 0.05,
            step_min: Vector3::new(1e-5, 1e-6, 1e-7),
            restart_distance: Vector3::new(0.1, 0.002, 0.0001),
            restarts: Restarts::WhenStalled,
        }
    }
}

/// Where the search ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonResult {
    /// The parameters with the least mean square that the search met.
    pub davis: Davis,
    /// Their mean square in (m/s)²; infinite when every computed train stopped.
    pub mean_square: f64,
    /// Iterations used.
    pub iterations: u32,
    /// Restarts drawn.
    pub restarts: u32,
    /// True when the mean square fell below ε1.
    pub has_converged: bool,
}

/// A reproducible source of restarts (SplitMix64, Steele et al. 2014).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RestartSource(u64);

impl RestartSource {
    /// Returns a source that gives the same restarts for the same seed.
    pub fn new(seed: u64) -> Self {
        RestartSource(seed)
    }

    /// Uniform in [0, 1).
    fn uniform(&mut self) -> f64 {
        (split_mix(&mut self.0) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Parameters uniform in the box, further than `distance` from `from` in each component
    /// as far as the box allows.
    fn draw(
        &mut self,
        bounds: &ParameterBox<3>,
        from: &Vector3<f64>,
        distance: &Vector3<f64>,
    ) -> Vector3<f64> {
        let mut drawn = *from;
        for _ in 0..100 {
            for i in 0..3 {
                drawn[i] = bounds.low[i] + (bounds.high[i] - bounds.low[i]) * self.uniform();
            }
            if (0..3).all(|i| (drawn[i] - from[i]).abs() > distance[i]) {
                break;
            }
        }
        drawn
    }
}

/// Runs Algorithm 1 from a start.
///
/// `speeds_mps` holds one more entry than `steps`, see [`deviation`].
///
/// # Real-time
///
/// At most `iterations_max` iterations of at most 31 trajectories each; no allocation.
pub fn wolfe_newton(
    steps: &[TrajectoryStep],
    speeds_mps: &[f64],
    start: &Davis,
    settings: &NewtonSettings,
    source: &mut RestartSource,
) -> NewtonResult {
    let evaluate = |theta: &Vector3<f64>| deviation(steps, speeds_mps, &davis_of(theta));
    let mut theta = Vector3::new(start.a, start.b, start.c);
    let mut here = evaluate(&theta);
    let mut result = NewtonResult {
        davis: *start,
        mean_square: f64::INFINITY,
        iterations: 0,
        restarts: 0,
        has_converged: false,
    };
    loop {
        let mean_square = here.map_or(f64::INFINITY, |deviation| deviation.mean_square);
        if mean_square < result.mean_square {
            (result.davis, result.mean_square) = (davis_of(&theta), mean_square);
        }
        result.has_converged = result.mean_square < settings.mean_square_max;
        if result.has_converged || result.iterations == settings.iterations_max {
            return result;
        }
        result.iterations += 1;
        let next = here.and_then(|here| newton_step(&theta, &here, settings, &evaluate));
        let is_stalled = next
            .is_none_or(|next| (0..3).all(|i| (next[i] - theta[i]).abs() < settings.step_min[i]));
        match (settings.restarts, next) {
            (Restarts::Never, Some(next)) if !is_stalled => theta = next,
            (Restarts::Never, _) => return result,
            (Restarts::WhenStalled, Some(next)) if !is_stalled => theta = next,
            _ => {
                theta = source.draw(&settings.bounds, &theta, &settings.restart_distance);
                result.restarts += 1;
            }
        }
        here = evaluate(&theta);
    }
}

fn davis_of(theta: &Vector3<f64>) -> Davis {
    Davis { a: theta[0], b: theta[1], c: theta[2] }
}

/// Step 10 of Algorithm 1: the full step of eq. 10 when it stays within the bounds, else the
/// first α = 1/2, 1/4, … that satisfies eq. 24 within the bounds.
fn newton_step(
    theta: &Vector3<f64>,
    here: &Deviation,
    settings: &NewtonSettings,
    evaluate: &impl Fn(&Vector3<f64>) -> Option<Deviation>,
) -> Option<Vector3<f64>> {
    let direction = here.hessian.lu().solve(&here.gradient)?;
    let full = theta - direction;
    if settings.bounds.contains(&full) {
        return Some(full);
    }
    let promised = here.gradient.dot(&direction);
    let mut alpha = 0.5;
    for _ in 0..30 {
        let candidate = theta - direction * alpha;
        if settings.bounds.contains(&candidate)
            && let Some(there) = evaluate(&candidate)
        {
            let has_decreased =
                there.mean_square <= here.mean_square - settings.decrease_share * alpha * promised;
            let is_flat_enough =
                -there.gradient.dot(&direction) >= -settings.slope_share * promised;
            if has_decreased && is_flat_enough {
                return Some(candidate);
            }
        }
        alpha *= 0.5;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::xia::trajectory::step::StepRule;
    use dynocar_model::force::mps2_per_n_per_kn;

    const TRUTH: Davis = Davis { a: 0.79, b: 0.0229, c: 0.001493 };

    fn example() -> (Vec<TrajectoryStep>, Vec<f64>) {
        let resistance_gain = mps2_per_n_per_kn(0.06);
        let mut speeds = vec![15.0];
        let mut steps = Vec::new();
        for i in 0..200 {
            let speed = *speeds.last().unwrap();
            let drive_mps2 = [0.4, 0.1, 0.0, -0.2][(i / 50) % 4];
            let step = TrajectoryStep { size: 100.0, drive_mps2, resistance_gain };
            speeds.push(StepRule::Distance.advance(&step, &TRUTH, speed).unwrap().speed_mps);
            steps.push(step);
        }
        (steps, speeds)
    }

    #[test]
    fn a_start_near_the_truth_converges_as_newton_does() {
        let (steps, speeds) = example();
        let settings = NewtonSettings { mean_square_max: 1e-16, ..NewtonSettings::of_the_paper() };
        let start = Davis { a: 0.8, b: 0.0225, c: 0.0015 };
        let mut source = RestartSource::new(1);
        let result = wolfe_newton(&steps, &speeds, &start, &settings, &mut source);
        assert!(result.has_converged && result.restarts == 0 && result.iterations < 8);
        assert!((result.davis.a - TRUTH.a).abs() < 1e-6);
    }

    #[test]
    fn the_same_seed_draws_the_same_restarts_within_the_bounds() {
        let (steps, speeds) = example();
        let settings = NewtonSettings { mean_square_max: 0.0, ..NewtonSettings::of_the_paper() };
        let start = Davis { a: 2.9, b: 0.19, c: 0.0099 };
        let run = |seed| {
            let mut source = RestartSource::new(seed);
            wolfe_newton(&steps, &speeds, &start, &settings, &mut source)
        };
        let result = run(5);
        assert_eq!(result, run(5));
        assert!(result.restarts > 0 && result.iterations == settings.iterations_max);
        let davis = result.davis;
        assert!(settings.bounds.contains(&Vector3::new(davis.a, davis.b, davis.c)));
    }

    #[test]
    fn without_restarts_a_train_that_stops_ends_the_search() {
        let (mut steps, speeds) = example();
        steps[10].drive_mps2 = -50.0;
        let settings =
            NewtonSettings { restarts: Restarts::Never, ..NewtonSettings::of_the_paper() };
        let mut source = RestartSource::new(1);
        let result = wolfe_newton(&steps, &speeds, &TRUTH, &settings, &mut source);
        assert!(!result.has_converged && result.mean_square == f64::INFINITY);
    }
}
