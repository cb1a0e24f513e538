//! The speeds that a resistance would have given a train, with their derivatives.

use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
use nalgebra::{SVector, Vector3};

use super::regression::{PARAMETERS, SPEED_SCALE_MPS, regressors};

/// A speed with the force that drives the train but for its basic resistance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrivenSpeed {
    /// Time in s.
    pub time_s: f64,
    /// Measured speed in m/s.
    pub speed_mps: f64,
    /// Traction minus brake, gradient, declared curve and tunnel resistance in N/kN; linear to
    /// the next sample.
    pub driving_n_per_kn: f64,
}

/// A stretch of unbroken motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrivenRun<'a> {
    /// Samples in the order of time; missing ones are simply absent.
    pub samples: &'a [DrivenSpeed],
    /// Rotating-mass factor gamma.
    pub rotating_mass_factor: f64,
}

/// Speed with its derivatives by the start speed and the scaled coefficients.
pub(super) type Sensitivity = SVector<f64, { 2 + PARAMETERS }>;

/// The median of the first few speeds.
pub(super) fn start_speed_mps(run: &DrivenRun) -> f64 {
    let mut first: Vec<f64> = run.samples.iter().take(5).map(|sample| sample.speed_mps).collect();
    first.sort_by(f64::total_cmp);
    first.get(first.len() / 2).copied().unwrap_or(0.0)
}

/// Measured less computed speed of every sample of every run.
pub(super) fn residuals(runs: &[DrivenRun], theta: &Vector3<f64>, starts_mps: &[f64]) -> Vec<f64> {
    let mut residuals = Vec::with_capacity(runs.iter().map(|run| run.samples.len()).sum());
    for (run, start_mps) in runs.iter().zip(starts_mps) {
        let mut samples = run.samples.iter();
        simulate(run, theta, *start_mps, |state| {
            residuals.extend(samples.next().map(|sample| sample.speed_mps - state[0]));
        });
    }
    residuals
}

/// The speed and its derivatives at every sample of a run, by the classical Runge-Kutta rule.
pub(super) fn simulate(
    run: &DrivenRun,
    theta: &Vector3<f64>,
    start_mps: f64,
    mut visit: impl FnMut(&Sensitivity),
) {
    let inertia = 1000.0 * (1.0 + run.rotating_mass_factor) / STANDARD_GRAVITY_MPS2;
    let mut state = Sensitivity::zeros();
    (state[0], state[1]) = (start_mps, 1.0);
    let mut before: Option<&DrivenSpeed> = None;
    for sample in run.samples {
        if let Some(before) = before {
            let step_s = sample.time_s - before.time_s;
            let middle = 0.5 * (before.driving_n_per_kn + sample.driving_n_per_kn);
            let at = |driving, state: &Sensitivity| rate(state, driving, theta, inertia);
            let k1 = at(before.driving_n_per_kn, &state);
            let k2 = at(middle, &(state + k1 * (0.5 * step_s)));
            let k3 = at(middle, &(state + k2 * (0.5 * step_s)));
            let k4 = at(sample.driving_n_per_kn, &(state + k3 * step_s));
            state += (k1 + (k2 + k3) * 2.0 + k4) * (step_s / 6.0);
        }
        before = Some(sample);
        visit(&state);
    }
}

/// Time derivative of the speed and of its derivatives.
fn rate(state: &Sensitivity, driving: f64, theta: &Vector3<f64>, inertia: f64) -> Sensitivity {
    // A trial step may stall the train; below standstill the resistance is that of standstill.
    let speed_mps = state[0].max(0.0);
    let powers = Vector3::from(regressors(speed_mps));
    let slope = (theta[1] + 2.0 * theta[2] * speed_mps / SPEED_SCALE_MPS) / SPEED_SCALE_MPS;
    let mut rate = state * (-slope / inertia);
    rate[0] = (driving - powers.dot(theta)) / inertia;
    for i in 0..PARAMETERS {
        rate[2 + i] -= powers[i] / inertia;
    }
    rate
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::regression::scaled;
    use super::*;
    use crate::train::Davis;

    pub const TRUTH: Davis = Davis { a: 2.2, b: 0.09, c: 0.016_848 };

    /// A coasting run from a speed, 0.2 s a sample.
    pub fn coasting(start_mps: f64, count: usize, davis: &Davis) -> Vec<DrivenSpeed> {
        let mut samples: Vec<_> = (0..count)
            .map(|i| DrivenSpeed { time_s: 0.2 * i as f64, speed_mps: 0.0, driving_n_per_kn: 0.0 })
            .collect();
        let mut speeds = Vec::new();
        let run = DrivenRun { samples: &samples, rotating_mass_factor: 0.06 };
        simulate(&run, &scaled(davis), start_mps, |state| speeds.push(state[0]));
        for (sample, speed_mps) in samples.iter_mut().zip(speeds) {
            sample.speed_mps = speed_mps;
        }
        samples
    }

    #[test]
    fn sensitivities_equal_finite_differences() {
        let samples = coasting(20.0, 400, &TRUTH);
        let run = DrivenRun { samples: &samples, rotating_mass_factor: 0.06 };
        let theta = scaled(&TRUTH);
        let speeds = |theta: &Vector3<f64>, start_mps: f64| {
            let mut speeds = Vec::new();
            simulate(&run, theta, start_mps, |state| speeds.push(state[0]));
            speeds
        };
        let mut states = Vec::new();
        simulate(&run, &theta, 20.0, |state| states.push(*state));
        let change = 1e-5;
        for place in 0..4 {
            let moved = |sign: f64| {
                let mut theta = theta;
                let mut start_mps = 20.0;
                match place {
                    0 => start_mps += sign * change,
                    _ => theta[place - 1] += sign * change,
                }
                speeds(&theta, start_mps)
            };
            for ((up, down), state) in moved(1.0).iter().zip(moved(-1.0)).zip(&states) {
                let difference = (up - down) / (2.0 * change);
                assert!((difference - state[1 + place]).abs() < 1e-7);
            }
        }
    }
}
