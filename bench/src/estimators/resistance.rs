//! Parts of estimators of the resistance: recursive least squares in all its forms; and the computed trajectory: one
//! hypothesis of the online filter, the bank of them, and warm fits over windows.

use std::rc::Rc;

use dynocar_core::filter::{Mils, Penalty, Rls};
use dynocar_estimators::xia::trajectory::fit::{
    DavisPrior, FitSettings, MotionSegment, TrajectoryFitter,
};
use dynocar_estimators::xia::trajectory::hypothesis::{JumpHypothesis, OutlierModel};
use dynocar_estimators::xia::trajectory::noise::{LearnedNoise, NoiseModel};
use dynocar_estimators::xia::trajectory::online::{OnlineFilter, OnlineSettings, StepDoubt};
use dynocar_estimators::xia::trajectory::step::{StepRule, TrajectoryStep};
use dynocar_model::force::mps2_per_n_per_kn;
use dynocar_model::train::Davis;
use dynocar_tests::chance::Chance;
use nalgebra::Vector3;

use super::measure::EstimatorCase;

type Row = (Vector3<f64>, f64);

const ROWS: usize = 1000;
const TRUTH: Vector3<f64> = Vector3::new(1.2, 0.5, 0.9);
const START_VARIANCE: f64 = 1e4;
/// p of multi-innovation least squares.
const LENGTH: usize = 6;
/// lambda / N of the regularised form.
const PENALTY: f64 = 4e-4;
const FORGETTING: f64 = 0.9998;

/// Returns the resistance over speeds of 5 to 35 m/s in units of 20 m/s, as coasting shows it.
fn rows() -> Rc<[Row]> {
    let mut random = Chance::new(7);
    (0..ROWS)
        .map(|_| {
            let speed = 0.25 + 1.5 * random.uniform();
            let features = Vector3::new(1.0, speed, speed * speed);
            (features, features.dot(&TRUTH) + 0.3 * random.normal())
        })
        .collect()
}

/// Returns the cases of least squares.
pub fn least_squares() -> Vec<EstimatorCase> {
    let rows = rows();
    let of = |name, run: fn(&[Row]) -> Vector3<f64>| {
        let rows = Rc::clone(&rows);
        EstimatorCase::new(name, ROWS, move || run(&rows))
    };
    vec![
        of("rls", |rows| rls(rows, 1.0)).aim(60.0),
        of("rls, directional forgetting", |rows| rls(rows, FORGETTING)),
        of("regularised rls", |rows| {
            let length = ROWS as u32;
            let lambda = Vector3::repeat(PENALTY * f64::from(length));
            mils::<1>(rows, Penalty { lambda, length, is_printed: true })
        }),
        of("mils, p = 6", |rows| mils::<LENGTH>(rows, Penalty::none())).aim(400.0),
    ]
}

fn rls(rows: &[Row], forgetting: f64) -> Vector3<f64> {
    let mut rls = Rls::new(Vector3::zeros(), &Vector3::repeat(START_VARIANCE), forgetting);
    for (features, observed) in rows {
        rls.update(features, *observed).expect("sound rows");
    }
    rls.belief.mean
}

fn mils<const L: usize>(rows: &[Row], penalty: Penalty<3>) -> Vector3<f64> {
    let start = Vector3::repeat(START_VARIANCE);
    let mut mils = Mils::<3, L>::new(Vector3::zeros(), &start, L, penalty);
    for (features, observed) in rows {
        mils.update(features, *observed).expect("sound rows");
    }
    *mils.estimate()
}

/// Rotating-mass factor of every run.
const ROTATING_MASS_FACTOR: f64 = 0.06;
const STEPS: usize = 1000;
const STEP_S: f64 = 0.2;
const FIRST_MPS: f64 = 25.0;
const HYPOTHESES: usize = 8;
const DECLARED: Davis = Davis { a: 1.0, b: 0.02, c: 0.0012 };
const DAVIS_STD: Vector3<f64> = Vector3::new(0.8, 0.03, 0.001);
/// No measurement is taken for an outlier.
const NO_OUTLIERS: OutlierModel = OutlierModel { share: 0.0, density: 0.5 };

/// Steps, and speeds in m/s before, between and after them.
type Run = (Vec<TrajectoryStep>, Vec<f64>);

/// Returns a run of steps of a size, whose drive in m/s² and resistance follow from the number of a step.
fn run(
    rule: StepRule,
    count: usize,
    size: f64,
    first_mps: f64,
    at: impl Fn(usize) -> (f64, Davis),
    mut noise_mps: impl FnMut() -> f64,
) -> Run {
    let mut speed_mps = first_mps;
    let (mut steps, mut speeds_mps) = (Vec::new(), vec![speed_mps]);
    for index in 0..count {
        let (drive_mps2, davis) = at(index);
        let resistance_gain = mps2_per_n_per_kn(ROTATING_MASS_FACTOR);
        let step = TrajectoryStep { size, drive_mps2, resistance_gain };
        speed_mps = rule.advance(&step, &davis, speed_mps).expect("the train rolls").speed_mps;
        steps.push(step);
        speeds_mps.push(speed_mps + noise_mps());
    }
    (steps, speeds_mps)
}

/// Returns the cases of the trajectory.
pub fn trajectories() -> Vec<EstimatorCase> {
    let mut random = Chance::new(3);
    // Traction and coasting by turns; the resistance grows by half midway.
    let at = |index| {
        let rain = if index < STEPS / 2 { 1.0 } else { 1.5 };
        let davis = Davis { a: 1.3 * rain, b: 0.015 * rain, c: 0.0014 * rain };
        (if (index / 100) % 2 == 0 { 0.12 } else { -0.02 }, davis)
    };
    let noise_mps = || 0.03 * random.normal();
    let run = Rc::new(run(StepRule::Time, STEPS, STEP_S, FIRST_MPS, at, noise_mps));
    let of = |name, pass: fn(&Run) -> Vector3<f64>| {
        let run = Rc::clone(&run);
        EstimatorCase::new(name, STEPS, move || pass(&run))
    };
    vec![
        of("trajectory filter step, one hypothesis", step_of_one),
        of("jump bank step, 8 hypotheses", step_of_bank).aim(3000.0),
        of("jump bank step, noise learned, published", step_as_run).aim(3000.0),
        fit(20).aim(10_000.0),
        fit(1000).aim(200_000.0),
    ]
}

/// Returns the noise that `trajectory_kalman` starts from.
fn noise(learns: bool) -> NoiseModel {
    let gain = mps2_per_n_per_kn(ROTATING_MASS_FACTOR);
    NoiseModel {
        speed_noise_mps: 0.03,
        speed_noise_range_mps: (1e-3, 1.0),
        disturbance: 0.2 * gain,
        disturbance_range: (0.01 * gain, 10.0 * gain),
        memory: 2000.0,
        learns_speed_noise: learns,
        learns_disturbance: learns,
    }
}

fn first_hypothesis(noise: &NoiseModel) -> JumpHypothesis {
    let mut first = JumpHypothesis::new(&DECLARED, &DAVIS_STD, LearnedNoise::new(noise));
    first.anchor(FIRST_MPS);
    first
}

fn step_of_one((steps, speeds_mps): &Run) -> Vector3<f64> {
    let model = noise(false);
    let mut filter = first_hypothesis(&model);
    for (step, &speed_mps) in steps.iter().zip(&speeds_mps[1..]) {
        filter.predict(StepRule::Time, step, STEP_S, 0.0);
        filter.measure(speed_mps, &model, &NO_OUTLIERS);
    }
    filter.davis_covariance().diagonal()
}

/// Runs the filter as the pipeline does, with or without the values that are published after each step.
fn step_of_filter(
    (steps, speeds_mps): &Run,
    learns_noise: bool,
    is_published: bool,
) -> Vector3<f64> {
    let mut filter = OnlineFilter::new(OnlineSettings {
        davis: DECLARED,
        davis_std: DAVIS_STD,
        jump_evidence: 16.0,
        hypotheses: HYPOTHESES,
        noise: noise(learns_noise),
    });
    filter.begin(FIRST_MPS);
    for (step, &speed_mps) in steps.iter().zip(&speeds_mps[1..]) {
        filter.advance((StepRule::Time, step), STEP_S, speed_mps, &StepDoubt::default());
        if is_published {
            std::hint::black_box(filter.davis());
        }
    }
    filter.davis().1.diagonal()
}

fn step_of_bank(run: &Run) -> Vector3<f64> {
    step_of_filter(run, false, false)
}

fn step_as_run(run: &Run) -> Vector3<f64> {
    step_of_filter(run, true, true)
}

/// Windows of a fitted run, and the samples by which each has moved on from the one before.
const WINDOWS: usize = 10;
const SLIDE: usize = 10;
const FIT_NOISE_MPS: f64 = 0.18;

/// Fits over windows of `samples` samples, each from the coefficients that the window before gave.
fn fit(samples: usize) -> EstimatorCase {
    let mut random = Chance::new(samples as u64);
    let truth = Davis { a: 0.79, b: 0.0229, c: 0.001493 };
    let at = |index| (if (index / 15) % 2 == 0 { 0.25 } else { 0.0 }, truth);
    // Of bounded size, so that nothing is an outlier.
    let noise_mps = || FIT_NOISE_MPS * (random.uniform() - 0.5) * 12f64.sqrt();
    let count = samples + SLIDE * WINDOWS;
    let (steps, speeds_mps) = run(StepRule::Distance, count, 100.0, 70.0, at, noise_mps);
    let prior = DavisPrior { davis: DECLARED, std: Vector3::new(0.3, 0.008, 0.0004) };
    let settings = FitSettings {
        prior: Some(prior),
        speed_noise_mps: Some(FIT_NOISE_MPS),
        ..FitSettings::new(StepRule::Distance)
    };
    let mut fitter = TrajectoryFitter::with_capacity(1, samples);
    let mut davis_after = move |window: usize, start: &Davis| {
        let (first, last) = (window * SLIDE, window * SLIDE + samples - 1);
        let (steps, speeds_mps) = (&steps[first..last], &speeds_mps[first..=last]);
        let found = fitter.fit(&[MotionSegment { steps, speeds_mps }], Some(start), &settings);
        found.expect("the window determines the coefficients").davis
    };
    let mut warm = vec![DECLARED];
    for window in 0..WINDOWS - 1 {
        warm.push(davis_after(window, &warm[window]));
    }
    EstimatorCase::new(format!("trajectory fit, warm, {samples} samples"), WINDOWS, move || {
        let of = |(window, start): (usize, &Davis)| davis_after(window, start).c;
        warm.iter().enumerate().map(of).sum::<f64>()
    })
}
