//! Integral least squares: where a trajectory fit starts.
//!
//! The measured speeds in the regressors make the integrated equation of motion linear:
//!
//! ```text
//! distance  ½ ṽ_i² - Σ Δs u = ½ v_0² - Σ κ Δs (a + b ṽ + c ṽ²)
//! time        ṽ_i  - Σ Δt u =    v_0 - Σ κ Δt (a + b ṽ + c ṽ²)
//! ```
//!
//! The sums average the noise of the regressors away, where the differenced equation would
//! amplify it (29 times worse in cruise). Without noise and with the distance rule the answer
//! is exact up to round-off.

use dynocar_core::filter::levenberg_marquardt::{
    LeastSquares, Linearisation, ParameterBox, SolverSettings, minimise,
};
use dynocar_core::filter::triangular::{TriangularAccumulator, TriangularSystem};
use nalgebra::Vector3;

use super::step::{MotionSegment, StepRule};

/// The linear problem: R x + z.
struct Linear(TriangularSystem<3>);

impl LeastSquares<3> for Linear {
    fn linearise(&mut self, point: &Vector3<f64>) -> Option<Linearisation<3>> {
        let mut system = self.0;
        system.residual += system.factor * point;
        let cost = 0.5 * system.residual.norm_squared();
        cost.is_finite().then_some(Linearisation { cost, system, nested_decrease: 0.0 })
    }
}

/// (a, b, c) by integral least squares within bounds, from where the data do not say.
///
/// `None` when a number is not finite.
///
/// # Real-time
///
/// One pass over the samples, no allocation.
pub fn integral_start(
    segments: &[MotionSegment<'_>],
    rule: StepRule,
    speed_noise_mps: f64,
    prior: Option<&TriangularSystem<3>>,
    bounds: &ParameterBox<3>,
    scales: &Vector3<f64>,
    from: &Vector3<f64>,
) -> Option<Vector3<f64>> {
    let mut joint = TriangularAccumulator::<4>::default();
    for segment in segments {
        let mut rows = integrated_rows(segment, rule, 1.0 / speed_noise_mps);
        for row in &rows.factor()[1..] {
            joint.push(&[row[1], row[2], row[3], row[4]]);
        }
    }
    let mut system = TriangularSystem::from_rows(&mut joint);
    if let Some(prior) = prior {
        for i in 0..3 {
            system.append(prior.factor.row(i).transpose(), prior.residual[i]);
        }
    }
    let settings = SolverSettings {
        scales: *scales,
        iterations_max: 4,
        decrease_tolerance: 1e-6,
        relative_tolerance: 1e-12,
    };
    Some(minimise(&mut Linear(system), from, bounds, &settings)?.point)
}

/// Rows \[initial, a, b, c, -left side\] in standard deviations, every one weighted to m/s.
fn integrated_rows(
    segment: &MotionSegment<'_>,
    rule: StepRule,
    per_deviation: f64,
) -> TriangularAccumulator<5> {
    let mut rows = TriangularAccumulator::default();
    let (mut drive, mut regressors) = (0.0, Vector3::zeros());
    for (i, &speed_mps) in segment.speeds_mps.iter().enumerate() {
        if let Some(step) = i.checked_sub(1).map(|before| &segment.steps[before]) {
            let before_mps = segment.speeds_mps[i - 1];
            let resisted_mps = match rule {
                StepRule::Distance => before_mps,
                StepRule::Time => 0.5 * (before_mps + speed_mps),
            };
            let reach = step.resistance_gain * step.size;
            drive += step.size * step.drive_mps2;
            let powers = Vector3::new(1.0, resisted_mps, resisted_mps * resisted_mps);
            regressors -= powers * reach;
        }
        let (left, weight) = match rule {
            StepRule::Distance => {
                (0.5 * speed_mps * speed_mps - drive, per_deviation / speed_mps.max(0.1))
            }
            StepRule::Time => (speed_mps - drive, per_deviation),
        };
        rows.push(&[
            weight,
            regressors[0] * weight,
            regressors[1] * weight,
            regressors[2] * weight,
            -left * weight,
        ]);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::super::test_runs::{FAST, normal, random, speeds, steps};
    use super::*;
    use dynocar_model::train::Davis;

    fn start(segments: &[MotionSegment<'_>], rule: StepRule) -> Vector3<f64> {
        let bounds = ParameterBox { low: Vector3::repeat(-10.0), high: Vector3::repeat(10.0) };
        let scales = Vector3::new(1.0, 0.02, 0.001);
        integral_start(segments, rule, 0.1, None, &bounds, &scales, &scales).unwrap()
    }

    #[test]
    fn the_distance_rule_is_solved_exactly_without_noise() {
        let steps = steps(StepRule::Distance, 300);
        let speeds = speeds(StepRule::Distance, &steps, &FAST, 12.0);
        let (first, second) = speeds.split_at(150);
        // Two segments with an initial speed each.
        let segments = [
            MotionSegment { steps: &steps[..149], speeds_mps: first },
            MotionSegment { steps: &steps[150..], speeds_mps: second },
        ];
        let found = start(&segments, StepRule::Distance);
        assert!((found[0] - FAST.a).abs() < 1e-9);
        assert!((found[1] - FAST.b).abs() < 1e-11);
        assert!((found[2] - FAST.c).abs() < 1e-13);
    }

    #[test]
    fn noise_leaves_a_start_near_the_answer() {
        for rule in [StepRule::Distance, StepRule::Time] {
            let steps = steps(rule, 300);
            let mut random = random(4);
            let mut speeds = speeds(rule, &steps, &FAST, 12.0);
            speeds.iter_mut().for_each(|speed| *speed += 0.1 * normal(&mut random));
            let found = start(&[MotionSegment { steps: &steps, speeds_mps: &speeds }], rule);
            let davis = Davis { a: found[0], b: found[1], c: found[2] };
            for speed_mps in [20.0, 60.0] {
                let error = davis.w0_n_per_kn(speed_mps) - FAST.w0_n_per_kn(speed_mps);
                assert!(error.abs() < 0.3, "{rule:?} {speed_mps}: {error}");
            }
        }
    }
}
