//! Xia 2023: Davis coefficients by trajectory fit. Table 3 and Figure 4: whole runs, without and with noise.
//!
//! - [`scenario`]: line, driver and true values from a seed, and the Cramér-Rao bound
//! - [`online`]: Table 4 (coefficients that switch on the way)

mod online;
mod scenario;

use dynocar_core::filter::levenberg_marquardt::{
    LeastSquares, Linearisation, ParameterBox, SolverSettings, minimise,
};
use dynocar_core::filter::triangular::{TriangularAccumulator, TriangularSystem};
use dynocar_estimators::xia::trajectory::fit::{
    FitSettings, MotionSegment, TrajectoryFit, TrajectoryFitter,
};
use dynocar_estimators::xia::trajectory::step::StepRule;
use dynocar_estimators::xia::wolfe_newton::{
    NewtonResult, NewtonSettings, RestartSource, Restarts, wolfe_newton,
};
use dynocar_model::train::Davis;
use dynocar_tests::chance::Chance;
use nalgebra::Vector3;

use self::scenario::{
    CASES, DrivingProfile, NoiseFreeRun, all_speeds_mps, bounds, davis_covariance, drive,
    fast_speeds_mps,
};
use super::row::{PaperRow, PaperScore, Seeds, XIA, w0_errors};
use crate::statistics::root_mean_square;

/// Returns every line of the comparison for this paper.
///
/// Each line has `seeds` runs; where the paper's method goes over a whole line of 120 km window by window it gets a
/// tenth of them, as the row states.
pub fn rows(seeds: Seeds) -> Vec<PaperRow> {
    let mut rows = convergence_rows(seeds);
    rows.extend(noise_free_rows(seeds));
    rows.extend(noise_rows(seeds));
    rows.extend(online::rows(seeds));
    rows
}

/// Identified a of Table 3, case by case.
const PUBLISHED_A: [f64; 4] = [0.7901, 0.2956, 1.0525, 0.3485];
/// The coefficients that the paper found under noise.
const PUBLISHED_NOISY: Davis = Davis { a: 0.483, b: 0.0273, c: 0.001492 };
/// ε1 of the paper without noise, in (m/s)².
const MEAN_SQUARE_CLEAN: f64 = 1e-5;

fn random_start(random: &mut Chance) -> Davis {
    let bounds = bounds();
    let theta: Vector3<f64> =
        bounds.low + (bounds.high - bounds.low).map(|width| width * random.uniform());
    Davis { a: theta[0], b: theta[1], c: theta[2] }
}

fn newton(
    run: &NoiseFreeRun,
    speeds_mps: &[f64],
    start: &Davis,
    restarts: Restarts,
    seed: u64,
) -> NewtonResult {
    let settings = NewtonSettings {
        bounds: bounds(),
        mean_square_max: MEAN_SQUARE_CLEAN,
        restarts,
        ..NewtonSettings::of_the_paper()
    };
    wolfe_newton(&run.steps, speeds_mps, start, &settings, &mut RestartSource::new(seed))
}

fn fit(
    run: &NoiseFreeRun,
    speeds_mps: &[f64],
    start: Option<&Davis>,
    bounds: ParameterBox<3>,
) -> Option<TrajectoryFit> {
    let settings = FitSettings { bounds, ..FitSettings::new(StepRule::Distance) };
    let segments = [MotionSegment { steps: &run.steps, speeds_mps }];
    TrajectoryFitter::default().fit(&segments, start, &settings).ok()
}

fn anywhere() -> ParameterBox<3> {
    ParameterBox { low: Vector3::repeat(-1e4), high: Vector3::repeat(1e4) }
}

/// The two runs of Table 3: name, driving, length in m.
const RUNS: [(&str, DrivingProfile, f64); 2] = [
    ("full speed profile, 25 km", DrivingProfile::Full, 25e3),
    ("cruise, 20 km", DrivingProfile::Cruise, 20e3),
];

/// Shares of random starts from which each method finds the truth.
pub fn convergence_rows(seeds: Seeds) -> Vec<PaperRow> {
    let mut rows = Vec::new();
    for (name, profile, length_m) in RUNS {
        for (case, truth) in CASES.iter().enumerate() {
            let mut converged = [0usize; 3];
            for seed in seeds.range() {
                let run = drive(profile, length_m, seed, |_| *truth);
                let start = random_start(&mut Chance::new(1000 + seed));
                let speeds = &run.speeds_mps;
                let never = newton(&run, speeds, &start, Restarts::Never, seed);
                let stalled = newton(&run, speeds, &start, Restarts::WhenStalled, seed);
                let ours = fit(&run, speeds, Some(&start), bounds());
                let found = ours.is_some_and(|fit| (fit.davis.a - truth.a).abs() < 1e-6);
                for (count, has_converged) in
                    converged.iter_mut().zip([never.has_converged, stalled.has_converged, found])
                {
                    *count += usize::from(has_converged);
                }
            }
            let share = |count: usize| Some(100.0 * count as f64 / seeds.count as f64);
            let quantity = format!("random starts that converge, case {}, {name}", case + 1);
            rows.push(PaperRow {
                published: Some(100.0),
                paper_method: share(converged[1]),
                baseline: share(converged[0]),
                ours: share(converged[2]),
                ..PaperRow::new(XIA, "Table 3", quantity, "%", seeds)
                    .noted("baseline: without restarts")
            });
        }
    }
    rows
}

/// Returns the error in a without noise: the paper's method where it converges, ours from integral least
/// squares; the runs differ in line and driver.
pub fn noise_free_rows(seeds: Seeds) -> Vec<PaperRow> {
    let mut rows = Vec::new();
    for (name, profile, length_m) in [
        ("full speed profile, 25 km", DrivingProfile::Full, 25e3),
        ("cruise, 120 km", DrivingProfile::Cruise, 120e3),
    ] {
        for (case, truth) in CASES.iter().enumerate() {
            let mut score = PaperScore::default();
            for seed in seeds.range() {
                let run = drive(profile, length_m, seed, |_| *truth);
                let speeds = &run.speeds_mps;
                if profile == DrivingProfile::Full {
                    let start = random_start(&mut Chance::new(1000 + seed));
                    let found = newton(&run, speeds, &start, Restarts::WhenStalled, seed);
                    if found.has_converged {
                        score.paper.push(found.davis.a - truth.a);
                    }
                }
                if let Some(fit) = fit(&run, speeds, None, bounds()) {
                    score.errors.push(fit.davis.a - truth.a);
                }
            }
            if score.errors.len() < seeds.count {
                score.errors.clear();
            }
            let quantity =
                format!("error in a without noise, case {}, {name}, where converged", case + 1);
            rows.push(PaperRow {
                published: Some((PUBLISHED_A[case] - truth.a).abs()),
                ..score.row(PaperRow::new(XIA, "Table 3", quantity, "N/kN", seeds))
            });
        }
    }
    rows
}

/// Figure 4: w0 from noisy runs compared with the bound.
pub fn noise_rows(seeds: Seeds) -> Vec<PaperRow> {
    let truth = CASES[0];
    let (fast, all) = (fast_speeds_mps(), all_speeds_mps());
    let cruise = drive(DrivingProfile::Cruise, 120e3, 1, |_| truth);
    let full = drive(DrivingProfile::Full, 40e3, 1, |_| truth);
    let [mut free, mut boxed, mut profile] = <[PaperScore; 3]>::default();
    let (cruise_bound, full_bound) =
        (davis_covariance(&cruise, &truth), davis_covariance(&full, &truth));
    for seed in seeds.range() {
        let mut random = Chance::new(seed);
        let speeds = cruise.measured_mps(0, &mut random);
        let errors = |davis: &Davis| w0_errors(davis, &truth, &fast);
        if let Some(found) = fit(&cruise, &speeds, None, anywhere()) {
            free.take_resistance((&found.davis, &found.covariance), &truth, &fast);
            free.take_bound(&cruise_bound, &fast);
            let minimum = paper_minimum(&cruise, &speeds, &found.davis, &anywhere());
            free.paper.extend(minimum.iter().flat_map(errors));
        }
        if let Some(found) = fit(&cruise, &speeds, None, bounds()) {
            boxed.errors.extend(errors(&found.davis));
            let minimum = paper_minimum(&cruise, &speeds, &found.davis, &bounds());
            boxed.paper.extend(minimum.iter().flat_map(errors));
        }
        let speeds = full.measured_mps(0, &mut random);
        if let Some(found) = fit(&full, &speeds, None, anywhere()) {
            profile.take_resistance((&found.davis, &found.covariance), &truth, &all);
            profile.take_bound(&full_bound, &all);
        }
    }
    let published = w0_errors(&PUBLISHED_NOISY, &truth, &fast);
    let line = |quantity: &str, score: &PaperScore| {
        score.row(PaperRow::new(XIA, "Figure 4", quantity, "N/kN", seeds))
    };
    vec![
        line("w0 over 270-305 km/h, cruise of 120 km, coefficients free", &free),
        PaperRow {
            published: Some(root_mean_square(&published)),
            ..line("w0 over 270-305 km/h, cruise of 120 km, within Table 2's bounds", &boxed)
        },
        line("w0 over 30-300 km/h, full speed profile of 40 km, coefficients free", &profile),
    ]
}

/// The minimum of the paper's deviation within bounds, with the first measured speed for v_0: the best possible result
/// of Algorithm 1.
struct PaperDeviation<'a> {
    run: &'a NoiseFreeRun,
    speeds_mps: &'a [f64],
}

impl LeastSquares<3> for PaperDeviation<'_> {
    fn linearise(&mut self, point: &Vector3<f64>) -> Option<Linearisation<3>> {
        let davis = Davis { a: point[0], b: point[1], c: point[2] };
        let mut speed_mps = self.speeds_mps[0];
        let mut by_davis = Vector3::zeros();
        let mut rows = TriangularAccumulator::<4>::default();
        let mut cost = 0.0;
        for (step, measured_mps) in self.run.steps.iter().zip(&self.speeds_mps[1..]) {
            let (advance, _) = StepRule::Distance.advance_or_crawl(step, &davis, speed_mps);
            by_davis = by_davis * advance.by_speed + advance.by_davis;
            speed_mps = advance.speed_mps;
            let residual = speed_mps - measured_mps;
            rows.push(&[by_davis[0], by_davis[1], by_davis[2], residual]);
            cost += 0.5 * residual * residual;
        }
        let system = TriangularSystem::from_rows(&mut rows);
        Some(Linearisation { cost, system, nested_decrease: 0.0 })
    }
}

fn paper_minimum(
    run: &NoiseFreeRun,
    speeds_mps: &[f64],
    start: &Davis,
    bounds: &ParameterBox<3>,
) -> Option<Davis> {
    let settings = SolverSettings {
        scales: Vector3::new(1.0, 0.02, 0.001),
        iterations_max: 100,
        decrease_tolerance: 1e-10,
        relative_tolerance: 1e-12,
    };
    let start = Vector3::new(start.a, start.b, start.c);
    let mut problem = PaperDeviation { run, speeds_mps };
    let found = minimise(&mut problem, &start, bounds, &settings)?.point;
    Some(Davis { a: found[0], b: found[1], c: found[2] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::papers::xia::scenario::{CASES, DrivingProfile, drive};
    use crate::statistics::KMH;

    #[test]
    fn the_scenarios_keep_to_their_speeds_and_forces() {
        for (profile, length_m, low_kmh, high_kmh) in [
            (DrivingProfile::Cruise, 120e3, 268.0, 306.0),
            (DrivingProfile::Full, 40e3, 6.9, 301.0),
        ] {
            for seed in 0..5 {
                let run = drive(profile, length_m, seed, |_| CASES[0]);
                assert_eq!(run.speeds_mps.len(), run.steps.len() + 1);
                for speed_mps in &run.speeds_mps {
                    let is_within = (low_kmh * KMH..high_kmh * KMH).contains(speed_mps);
                    assert!(is_within, "{profile:?}, seed {seed}: {speed_mps} m/s");
                }
            }
        }
    }

    #[test]
    fn the_bound_is_that_of_the_estimators_own_derivatives() {
        use dynocar_estimators::xia::trajectory::fit::{
            FitSettings, MotionSegment, TrajectoryFitter,
        };
        use dynocar_estimators::xia::trajectory::step::StepRule;
        let run = drive(DrivingProfile::Full, 25e3, 1, |_| CASES[0]);
        let numerical = scenario::davis_covariance(&run, &CASES[0]);
        let settings = FitSettings {
            speed_noise_mps: Some(scenario::SPEED_NOISE_MPS),
            ..FitSettings::new(StepRule::Distance)
        };
        let segments = [MotionSegment { steps: &run.steps, speeds_mps: &run.speeds_mps }];
        let fit = TrajectoryFitter::default().fit(&segments, None, &settings).unwrap();
        for i in 0..3 {
            let ratio = fit.covariance[(i, i)] / numerical[(i, i)];
            assert!((ratio - 1.0).abs() < 1e-3, "{i}: {ratio}");
        }
    }

    #[test]
    fn a_few_runs_already_show_what_the_full_comparison_does() {
        let by = |rows: Vec<PaperRow>, unit: &str| -> Vec<f64> {
            let of_unit = rows.into_iter().filter(|row| row.unit == unit);
            of_unit.map(|row| row.ours.expect("every line has our figure")).collect()
        };
        assert!(by(convergence_rows(Seeds::from_zero(2)), "%").iter().all(|share| *share == 100.0));
        assert!(by(noise_free_rows(Seeds::from_zero(2)), "N/kN").iter().all(|error| *error < 1e-9));
        let online = online::rows(Seeds::from_zero(2));
        assert!(by(online.clone(), "N/kN")[0] < 0.2);
        assert!(by(online, "km").iter().all(|settling| *settling < 3.0));
    }
}
