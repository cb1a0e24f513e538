//! The mean squared deviation of Xia 2023 with its analytic gradient and Hessian.
//!
//! Equations 7-8 and 11-23, corrected (finite differences below verify each correction):
//!
//! - eq. 8, 11, 16: the norm forms lack the factor 1/I that the sum forms have;
//! - eq. 13: k = \[v_{i-1} - λ (b + 2 c v_{i-1})\] / v_i, with the brackets;
//! - eq. 14: the first term is k ∂v_{i-1}/∂b, not k ∂v_{i-1}/∂a;
//! - eq. 16: + (v_i - ṽ_i) ∇²v_i, where the norm form prints minus;
//! - eq. 18 (lines 2, 3) to 23: + q with q = (1 - 2 λ c) / v_i, not - q.

use dynocar_model::train::Davis;
use nalgebra::{Matrix3, Vector3};

use crate::xia::trajectory::step::{StepRule, TrajectoryStep};

/// f(θ) of eq. 8 with derivatives with respect to (a, b, c).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// f: mean of (v_i - ṽ_i)² over the steps, in (m/s)².
    pub mean_square: f64,
    /// ∇f, eq. 11.
    pub gradient: Vector3<f64>,
    /// ∇²f, eq. 16.
    pub hessian: Matrix3<f64>,
}

/// Deviation of the trajectory computed by eq. 7 from the measured speeds.
///
/// `speeds_mps` holds one more entry than `steps`; the first is the speed before the first
/// step, which the paper takes for exact. `None` when the computed train stops (v² < 0), which
/// happens for up to 95 % of random parameters on long data with braking.
pub fn deviation(steps: &[TrajectoryStep], speeds_mps: &[f64], davis: &Davis) -> Option<Deviation> {
    debug_assert_eq!(steps.len() + 1, speeds_mps.len());
    let (&first_mps, measured_mps) = speeds_mps.split_first()?;
    let mut speed_mps = first_mps;
    let mut slope = Vector3::zeros();
    let mut curvature = Matrix3::zeros();
    let mut sum =
        Deviation { mean_square: 0.0, gradient: Vector3::zeros(), hessian: Matrix3::zeros() };
    for (step, measured_mps) in steps.iter().zip(measured_mps) {
        let advance = StepRule::Distance.advance(step, davis, speed_mps)?;
        let reach = step.resistance_gain * step.size;
        let k = advance.by_speed;
        let u = 1.0 / advance.speed_mps;
        let p = reach * u;
        let q = (1.0 - 2.0 * reach * davis.c) * u;
        let next_slope = slope * k + advance.by_davis;
        // -p times the derivative of the regressors (1, v, v²) with respect to the speed.
        let mixed = Vector3::new(0.0, -p, -2.0 * p * speed_mps);
        curvature = curvature * k + slope * slope.transpose() * q
            - next_slope * next_slope.transpose() * u
            + mixed * slope.transpose()
            + slope * mixed.transpose();
        slope = next_slope;
        speed_mps = advance.speed_mps;
        let residual = speed_mps - measured_mps;
        sum.mean_square += residual * residual;
        sum.gradient += slope * residual;
        sum.hessian += slope * slope.transpose() + curvature * residual;
    }
    let per_step = 1.0 / steps.len() as f64;
    sum.mean_square *= per_step;
    sum.gradient *= 2.0 * per_step;
    sum.hessian *= 2.0 * per_step;
    sum.mean_square.is_finite().then_some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_model::force::mps2_per_n_per_kn;

    const TRUTH: Davis = Davis { a: 0.79, b: 0.0229, c: 0.001493 };
    const SCALES: [f64; 3] = [1.0, 0.02, 0.001];

    /// Returns the traction, coasting and braking over hills; the measured speeds carry a wave as noise.
    fn example() -> (Vec<TrajectoryStep>, Vec<f64>) {
        let gain = mps2_per_n_per_kn(0.06);
        let steps: Vec<TrajectoryStep> = (0..60)
            .map(|i| {
                let drive = [0.35, 0.12, 0.0, -0.25][(i / 15) % 4];
                let drive_mps2 = drive + 0.05 * (f64::from(i as u32) * 0.7).sin();
                TrajectoryStep { size: 100.0, drive_mps2, resistance_gain: gain }
            })
            .collect();
        let mut speeds = vec![40.0];
        for step in &steps {
            let last = *speeds.last().unwrap();
            speeds.push(StepRule::Distance.advance(step, &TRUTH, last).unwrap().speed_mps);
        }
        for (i, speed) in speeds.iter_mut().enumerate() {
            *speed += 0.2 * (i as f64 * 1.3).sin();
        }
        (steps, speeds)
    }

    fn moved(davis: &Davis, parameter: usize, by: f64) -> Davis {
        let Davis { a, b, c } = *davis;
        match parameter {
            0 => Davis { a: a + by, b, c },
            1 => Davis { a, b: b + by, c },
            _ => Davis { a, b, c: c + by },
        }
    }

    /// Fourth-order central difference of a function of one scaled parameter.
    fn difference(at: impl Fn(f64) -> f64, width: f64) -> f64 {
        (8.0 * (at(width) - at(-width)) - (at(2.0 * width) - at(-2.0 * width))) / (12.0 * width)
    }

    #[test]
    fn gradient_and_hessian_match_finite_differences_to_1e_minus_8() {
        let (steps, speeds) = example();
        for davis in [TRUTH, Davis { a: 1.9, b: 0.05, c: 0.0006 }] {
            let here = deviation(&steps, &speeds, &davis).unwrap();
            let mut largest: f64 = 0.0;
            for i in 0..3 {
                let at =
                    |x: f64| deviation(&steps, &speeds, &moved(&davis, i, x * SCALES[i])).unwrap();
                let width = 2e-3;
                let slope = difference(|x| at(x).mean_square, width);
                let scale = here.gradient.component_mul(&Vector3::from(SCALES)).norm();
                largest = largest.max((slope - here.gradient[i] * SCALES[i]).abs() / scale);
                for j in 0..3 {
                    let slope = difference(|x| at(x).gradient[j] * SCALES[j], width);
                    let exact = here.hessian[(i, j)] * SCALES[i] * SCALES[j];
                    let diagonal = |k: usize| (here.hessian[(k, k)]).abs().sqrt() * SCALES[k];
                    largest = largest.max((slope - exact).abs() / (diagonal(i) * diagonal(j)));
                }
            }
            assert!(largest < 1e-8, "{largest:e}");
        }
    }

    #[test]
    fn the_printed_equations_14_and_18_are_refuted() {
        let (steps, speeds) = example();
        let end = |davis: Davis| {
            steps.iter().fold(speeds[0], |speed, step| {
                StepRule::Distance.advance(step, &davis, speed).unwrap().speed_mps
            })
        };
        let by_b = difference(|x| end(moved(&TRUTH, 1, x)), 1e-5);
        let second = |width: f64| {
            let at = |x: f64| end(moved(&TRUTH, 0, x));
            (at(width) - 2.0 * at(0.0) + at(-width)) / (width * width)
        };
        let by_a_twice = second(1e-2);
        let mut speed = speeds[0];
        let (mut by_a, mut by_b_printed) = (0.0, 0.0);
        let (mut twice, mut twice_printed) = (0.0, 0.0);
        for step in &steps {
            let advance = StepRule::Distance.advance(step, &TRUTH, speed).unwrap();
            let u = 1.0 / advance.speed_mps;
            let q = (1.0 - 2.0 * step.resistance_gain * step.size * TRUTH.c) * u;
            by_b_printed = advance.by_speed * by_a + advance.by_davis[1];
            let next_by_a = advance.by_speed * by_a + advance.by_davis[0];
            let rest = -u * next_by_a * next_by_a;
            twice = advance.by_speed * twice + q * by_a * by_a + rest;
            twice_printed = advance.by_speed * twice_printed - q * by_a * by_a + rest;
            (by_a, speed) = (next_by_a, advance.speed_mps);
        }
        // Equation 14 with the derivative with respect to a in it.
        assert!((by_b_printed / by_b - 1.0).abs() > 0.9, "{by_b_printed} {by_b}");
        // Equation 18 with + q, and with the printed - q.
        assert!((twice / by_a_twice - 1.0).abs() < 1e-4, "{twice} {by_a_twice}");
        assert!((twice_printed / by_a_twice - 1.0).abs() > 5.0, "{twice_printed} {by_a_twice}");
    }

    #[test]
    fn a_train_that_stops_has_no_deviation() {
        let (mut steps, speeds) = example();
        steps[30].drive_mps2 = -20.0;
        assert_eq!(deviation(&steps, &speeds, &TRUTH), None);
    }
}
