//! Adhesion and brake friction: a window of 40 samples by EM and by the smoother, and the step of the extended Kalman
//! filter.

use std::rc::Rc;

use dynocar_core::pipeline::braking::engine::{BrakingObservation, Engine};
use dynocar_core::pipeline::braking::law::BrakingLaw;
use dynocar_core::pipeline::braking::motion::{MotionNoise, StepInputs, Walk};
use dynocar_core::pipeline::braking::settings::BrakingSettings;
use dynocar_core::pipeline::braking::tracker::{PriorScale, Tracker, TrackerModel};
use dynocar_estimators::xie::{EmSettings, EmWindow, KalmanExpectation, ParticleExpectation};
use dynocar_shared::Uncertain;

use super::measure::EstimatorCase;
use crate::papers::braking::{BrakingMoment, XIE_TABLE_2};

/// Samples of a window.
const SAMPLES: usize = 40;
/// Windows in a pass.
const WINDOWS: u64 = 8;
/// Steps in a pass of the filter.
const STEPS: usize = 199;
/// Number of samples by which the smoothed estimate lags.
const LAG: usize = 25;
/// Noise of motion and measurement (Xie 2019), as variances.
const NOISE: MotionNoise = MotionNoise {
    distance_m2_per_s: 0.0167,
    speed_m2_per_s3: 0.00129,
    measured_distance_m2: 0.01,
    measured_speed_m2_per_s2: None,
};
/// Where estimates start.
const INITIAL: f64 = 0.07;
/// Standard deviation in m/s of a window's first speed.
const FIRST_SPEED_STD_MPS: f64 = 0.1;
/// The step of every sample.
const INPUTS: StepInputs = StepInputs {
    step_s: 0.2,
    gain_mps2: 9.81,
    demand: 0.0942,
    tied_mps2: 0.0,
    basic_mps2: [0.0077, 2.3e-4, 1.46e-5],
};

/// Returns the first observations of a braking on a wet rail.
fn braking(samples: usize, seed: u64) -> Vec<BrakingObservation> {
    let observation = |it: &BrakingMoment| BrakingObservation {
        distance_m: it.measured_m,
        speed_mps: it.speed_mps,
        is_speed_valid: false,
        demand: INPUTS.demand,
    };
    XIE_TABLE_2.simulate(seed)[..samples].iter().map(observation).collect()
}

/// Measures an engine over some brakings, each from a fresh start and of a fixed number of updates.
fn case(
    name: &str,
    brakings: &Rc<[Vec<BrakingObservation>]>,
    updates: usize,
    mut engine: impl Engine + 'static,
) -> EstimatorCase {
    let brakings = Rc::clone(brakings);
    EstimatorCase::new(name, updates * brakings.len(), move || {
        let mut found = 0.0;
        for braking in brakings.iter() {
            engine.start(&braking[0]);
            for observation in &braking[1..] {
                engine.step(&INPUTS, observation).expect("a sound braking");
            }
            found += engine.estimate().expect("it has begun").coefficient.value;
        }
        found
    })
}

fn tracker(walk: Walk, lag: usize) -> Tracker {
    let prior = PriorScale::OfLaw(Uncertain::new(INITIAL, 0.05));
    let first_speed_std_mps = FIRST_SPEED_STD_MPS;
    let model =
        TrackerModel { law: BrakingLaw::Constant, noise: NOISE, walk, first_speed_std_mps, prior };
    Tracker::new(model, lag as f64 * INPUTS.step_s, lag, false)
}

/// Returns the cases of this module.
pub fn cases() -> Vec<EstimatorCase> {
    let windows: Rc<[_]> = (1..=WINDOWS).map(|seed| braking(SAMPLES, seed)).collect();
    let long: Rc<[_]> = [braking(STEPS + 1, 99)].into();
    let settings = EmSettings {
        braking: BrakingSettings {
            first_speed_std_mps: FIRST_SPEED_STD_MPS,
            ..BrakingSettings::default()
        },
        window: SAMPLES,
        tolerance: 0.0,
        initial: Some(INITIAL),
        ..EmSettings::default()
    };
    let particles = EmWindow::new(settings, NOISE, ParticleExpectation::new(20, SAMPLES, 11));
    let exact = EmWindow::new(settings, NOISE, KalmanExpectation::new(SAMPLES));
    let smoother = tracker(Walk::Drift { std_per_s: 0.005, time_s: 20.0 }, LAG);
    let filter = tracker(Walk::Scale(1e-6), 0);
    vec![
        case("EM window, 20 particles, 50 iterations, 40 samples", &windows, 1, particles).aim(3e6),
        case("EM window, Kalman E-step, 50 iterations, 40 samples", &windows, 1, exact),
        case("fixed-lag smoother, window of 40 samples", &windows, 1, smoother).aim(20_000.0),
        case("braking EKF step", &long, STEPS, filter),
    ]
}
