//! Davis coefficients from whole trajectories, offline or over a window.
//!
//! All segments share a, b and c; each has its own initial speed. The start is integral least
//! squares, the search Gauss-Newton with damping within bounds: no restarts are needed. The
//! noise of the measured speed is estimated with the coefficients unless it is given.
//!
//! In the integral least squares the measured speeds in the regressors make the integrated equation of motion linear:
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
use dynocar_model::train::Davis;
use nalgebra::Vector3;

use super::residuals::InitialSpeeds;
use super::search::{Buffers, SCALES, TrajectorySearch};
use super::step::{StepRule, TrajectoryStep};

pub use super::search::{DavisPrior, FitError, FitSettings, TrajectoryFit};
pub use super::step::MotionSegment;

/// Fits trajectories; keeps its buffers between fits.
#[derive(Clone, Debug, Default)]
pub struct TrajectoryFitter {
    buffers: Buffers,
}

impl TrajectoryFitter {
    /// Returns a fitter that allocates nothing for `segments` segments and `samples` samples in all.
    pub fn with_capacity(segments: usize, samples: usize) -> Self {
        TrajectoryFitter {
            buffers: Buffers {
                initial: InitialSpeeds::with_capacity(segments),
                residuals: Vec::with_capacity(samples),
            },
        }
    }

    /// Fits all segments jointly, from integral least squares or from given coefficients.
    ///
    /// # Errors
    ///
    /// See [`FitError`].
    ///
    /// # Real-time
    ///
    /// No allocation within the capacity; time grows with the samples, a few passes for a warm
    /// start with known noise.
    pub fn fit(
        &mut self,
        segments: &[MotionSegment<'_>],
        start: Option<&Davis>,
        settings: &FitSettings,
    ) -> Result<TrajectoryFit, FitError> {
        check(segments)?;
        let prior = settings.prior.map(|prior| prior.rows());
        let point = match start {
            Some(davis) => Vector3::new(davis.a, davis.b, davis.c),
            None => {
                let from = settings.prior.map_or(Vector3::from(SCALES), |prior| {
                    Vector3::new(prior.davis.a, prior.davis.b, prior.davis.c)
                });
                let noise_mps = settings.speed_noise_mps.unwrap_or(0.1);
                integral_start(
                    segments,
                    settings.rule,
                    noise_mps,
                    prior.as_ref(),
                    &settings.bounds,
                    &settings.bounds.clamp(&from),
                )
                .ok_or(FitError::NotFinite { segment: 0 })?
            }
        };
        self.buffers.initial.reset(segments.iter().map(|segment| segment.speeds_mps[0]));
        let mut search = TrajectorySearch::new(segments, settings, prior, &mut self.buffers);
        let fitted = search.run(&point)?;
        search.describe(&fitted)
    }
}

fn check(segments: &[MotionSegment<'_>]) -> Result<(), FitError> {
    let mut samples = 0;
    for (index, segment) in segments.iter().enumerate() {
        let (steps, speeds) = (segment.steps.len(), segment.speeds_mps.len());
        if speeds != steps + 1 {
            return Err(FitError::LengthMismatch { segment: index, steps, speeds });
        }
        let is_usable = |step: &TrajectoryStep| {
            step.size > 0.0
                && step.size.is_finite()
                && step.drive_mps2.is_finite()
                && step.resistance_gain.is_finite()
        };
        if !(segment.steps.iter().all(is_usable)
            && segment.speeds_mps.iter().all(|speed| speed.is_finite()))
        {
            return Err(FitError::NotFinite { segment: index });
        }
        samples += speeds;
    }
    let need = segments.len() + 3;
    if samples < need { Err(FitError::TooFewSamples { need, got: samples }) } else { Ok(()) }
}

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
        scales: Vector3::from(SCALES),
        iterations_max: 4,
        decrease_tolerance: 1e-6,
        relative_tolerance: 1e-12,
    };
    Some(minimise(&mut Linear(system), from, bounds, &settings)?.point)
}

/// Returns the rows \[initial, a, b, c, -left side\] in standard deviations, every one weighted to m/s.
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
    use rand::RngExt;

    use super::super::step::StepRule;
    use super::super::tests::{FAST, normal, random, speeds, steps};
    use super::*;
    use dynocar_core::filter::levenberg_marquardt::ParameterBox;
    use dynocar_model::force::mps2_per_n_per_kn;

    fn fit(steps: &[TrajectoryStep], speeds_mps: &[f64], settings: &FitSettings) -> TrajectoryFit {
        let segments = [MotionSegment { steps, speeds_mps }];
        TrajectoryFitter::default().fit(&segments, None, settings).unwrap()
    }

    fn free(rule: StepRule) -> FitSettings {
        let bounds = ParameterBox { low: Vector3::repeat(-1e3), high: Vector3::repeat(1e3) };
        FitSettings { bounds, ..FitSettings::new(rule) }
    }

    #[test]
    fn without_noise_both_rules_give_the_coefficients_up_to_round_off() {
        for rule in [StepRule::Distance, StepRule::Time] {
            let steps = steps(rule, 400);
            let speeds = speeds(rule, &steps, &FAST, 12.0);
            let fit = fit(&steps, &speeds, &FitSettings::new(rule));
            assert!((fit.davis.a - FAST.a).abs() < 1e-9, "{rule:?}: {:e}", fit.davis.a - FAST.a);
            assert!((fit.davis.c - FAST.c).abs() < 1e-12);
            assert_eq!((fit.stalls, fit.at_bound), (0, [false; 3]));
        }
    }

    #[test]
    fn every_random_start_ends_at_the_same_coefficients() {
        let steps = steps(StepRule::Distance, 300);
        let speeds = speeds(StepRule::Distance, &steps, &FAST, 12.0);
        let segments = [MotionSegment { steps: &steps, speeds_mps: &speeds }];
        let settings = FitSettings::new(StepRule::Distance);
        let mut random = random(5);
        for _ in 0..50 {
            let start = Davis {
                a: 3.0 * random.random::<f64>(),
                b: 0.2 * random.random::<f64>(),
                c: 0.01 * random.random::<f64>(),
            };
            let fit = TrajectoryFitter::default().fit(&segments, Some(&start), &settings).unwrap();
            assert!((fit.davis.a - FAST.a).abs() < 1e-8, "{start:?}: {fit:?}");
        }
    }

    #[test]
    fn a_few_wild_speeds_hardly_move_the_fit() {
        let rule = StepRule::Distance;
        let steps = steps(rule, 400);
        let mut random = random(2);
        let mut speeds = speeds(rule, &steps, &FAST, 12.0);
        speeds.iter_mut().for_each(|speed| *speed += 0.1 * normal(&mut random));
        let clean = fit(&steps, &speeds, &free(rule));
        for index in [40, 41, 120, 200, 333] {
            speeds[index] += 3.0;
        }
        let spoilt = fit(&steps, &speeds, &free(rule));
        assert_eq!(spoilt.outliers, 5);
        for speed_mps in [20.0, 50.0, 75.0] {
            let apart = spoilt.davis.w0_n_per_kn(speed_mps) - clean.davis.w0_n_per_kn(speed_mps);
            assert!(apart.abs() < clean.w0_std_n_per_kn(speed_mps), "{speed_mps}: {apart}");
        }
    }

    #[test]
    fn a_prior_binds_what_the_data_leave_open() {
        // Ten steps of cruise at one speed determine w0 there and nothing else.
        let gain = mps2_per_n_per_kn(0.06);
        let drive_mps2 = gain * FAST.w0_n_per_kn(80.0);
        let steps = vec![TrajectoryStep { size: 1.0, drive_mps2, resistance_gain: gain }; 10];
        let speeds = vec![80.0; 11];
        let expected = Davis { a: 1.0, b: 0.02, c: 0.0014 };
        let std = Vector3::new(0.5, 0.01, 0.0005);
        let settings = FitSettings {
            prior: Some(DavisPrior { davis: expected, std }),
            speed_noise_mps: Some(1e-3),
            ..FitSettings::new(StepRule::Time)
        };
        let fit = fit(&steps, &speeds, &settings);
        assert!((fit.davis.w0_n_per_kn(80.0) - FAST.w0_n_per_kn(80.0)).abs() < 0.01);
        assert!((fit.davis.a - expected.a).abs() < 0.05);
        assert!(fit.covariance[(0, 0)].sqrt() > 0.4);
        assert!(fit.w0_std_n_per_kn(80.0) < 0.05);
    }

    #[test]
    fn bad_input_is_refused_with_what_is_wrong() {
        let steps = steps(StepRule::Distance, 20);
        let speeds = speeds(StepRule::Distance, &steps, &FAST, 40.0);
        let settings = FitSettings::new(StepRule::Distance);
        let error = |steps: &[TrajectoryStep], speeds_mps: &[f64], settings: &FitSettings| {
            let segments = [MotionSegment { steps, speeds_mps }];
            TrajectoryFitter::default().fit(&segments, None, settings).unwrap_err()
        };
        let mut holed = speeds.clone();
        holed[7] = f64::NAN;
        let mut backwards = steps.clone();
        backwards[3].size = -100.0;
        assert!(matches!(
            error(&steps, &speeds[1..], &settings),
            FitError::LengthMismatch { segment: 0, steps: 20, speeds: 20 }
        ));
        assert_eq!(error(&steps, &holed, &settings), FitError::NotFinite { segment: 0 });
        assert_eq!(error(&backwards, &speeds, &settings), FitError::NotFinite { segment: 0 });
        assert_eq!(
            error(&steps[..2], &speeds[..3], &settings),
            FitError::TooFewSamples { need: 4, got: 3 }
        );
    }
}

#[cfg(test)]
mod integral_start_tests {
    use super::*;
    use crate::xia::trajectory::tests::{FAST, normal, random, speeds, steps};
    use dynocar_model::train::Davis;

    fn start(segments: &[MotionSegment<'_>], rule: StepRule) -> Vector3<f64> {
        let bounds = ParameterBox { low: Vector3::repeat(-10.0), high: Vector3::repeat(10.0) };
        integral_start(segments, rule, 0.1, None, &bounds, &Vector3::from(SCALES)).unwrap()
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
