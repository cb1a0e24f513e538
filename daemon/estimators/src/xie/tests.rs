//! Expectation maximisation of the adhesion, by particles and by a Kalman smoother.

use dynocar_core::filter::Gaussian;
use dynocar_core::filter::random::Random;
use dynocar_core::pipeline::braking::engine::{BrakingObservation, Engine, EngineStep};
use dynocar_core::pipeline::braking::law::BrakingLaw;
use dynocar_core::pipeline::braking::motion::{self, MotionNoise, StepInputs, Walk};
use dynocar_core::pipeline::braking::settings::BrakingSettings;
use dynocar_core::pipeline::braking::tracker::{PriorScale, Tracker, TrackerModel};
use dynocar_shared::Uncertain;
use nalgebra::SVector;

use super::expectation::{MoveNoise, ObservedStep};
use super::*;

const NOISE: MotionNoise = MotionNoise {
    distance_m2_per_s: 0.0167,
    speed_m2_per_s3: 0.00129,
    measured_distance_m2: 0.01,
    measured_speed_m2_per_s2: None,
};
const STEPS: usize = 40;
const TRUTH: f64 = 0.08;
const DEMAND: f64 = 0.0942;
const FIRST_MPS: f64 = 80.0;

fn inputs() -> StepInputs {
    StepInputs {
        step_s: 0.2,
        gain_mps2: 9.81,
        demand: DEMAND,
        tied_mps2: 0.0,
        basic_mps2: [0.0077, 2.3e-4, 1.46e-5],
    }
}

/// Returns the measured distances of a braking with a constant coefficient.
fn observed(seed: u64) -> Vec<BrakingObservation> {
    let mut random = Random::new(seed);
    let (mut distance_m, mut speed_mps) = (0.0, FIRST_MPS);
    let noise = MoveNoise::over(&NOISE, 0.2);
    (0..STEPS)
        .map(|_| {
            let observation = BrakingObservation {
                distance_m: distance_m + 0.1 * random.normal(),
                speed_mps,
                is_speed_valid: false,
                demand: DEMAND,
            };
            let moved = motion::advance(&inputs(), &BrakingLaw::Constant, speed_mps, TRUTH);
            distance_m += moved.travelled_m + noise.stds[0] * random.normal();
            speed_mps = moved.speed_mps + noise.stds[1] * random.normal();
            observation
        })
        .collect()
}

fn model(initial: f64) -> EmSettings {
    EmSettings {
        braking: BrakingSettings { first_speed_std_mps: 0.1, ..BrakingSettings::default() },
        window: STEPS,
        tolerance: 0.0,
        initial: Some(initial),
        ..EmSettings::default()
    }
}

fn window(seed: u64) -> ObservedWindow {
    let noise = MoveNoise::over(&NOISE, 0.2);
    let entries: Vec<_> = observed(seed)
        .into_iter()
        .map(|observed| ObservedStep { inputs: inputs(), observed, noise })
        .collect();
    let first = Gaussian::independent(
        SVector::from([entries[0].observed.distance_m, FIRST_MPS]),
        SVector::from([0.1, 0.1]),
    );
    ObservedWindow { entries, first }
}

/// Returns the estimate after one window.
fn estimate<E: Expectation>(model: EmSettings, expectation: E, seed: u64) -> Uncertain {
    let mut em = EmWindow::new(model, NOISE, expectation);
    let observed = observed(seed);
    em.start(&BrakingObservation { speed_mps: FIRST_MPS, ..observed[0] });
    let mut last = EngineStep::Collected;
    for observation in &observed[1..] {
        assert_eq!(last, EngineStep::Collected);
        last = em.step(&inputs(), observation).unwrap();
    }
    assert_eq!(last, EngineStep::Updated { normalised_innovation: None });
    em.estimate().unwrap().coefficient
}

#[test]
fn many_particles_give_the_expectation_of_the_kalman_smoother() {
    let window = window(1);
    let at = |coefficient: f64| WindowModel {
        window: &window,
        noise: &NOISE,
        share: coefficient / DEMAND,
        has_printed_cap: false,
    };
    let mut exact = KalmanExpectation::new(STEPS);
    let exact_statistics = exact.expect(&at(TRUTH)).unwrap();
    let mut particles = ParticleExpectation::new(1000, STEPS, 3);
    let statistics = particles.expect(&at(TRUTH)).unwrap();
    assert!((statistics.curvature / exact_statistics.curvature - 1.0).abs() < 1e-9);
    let difference = DEMAND * (statistics.newton_step() - exact_statistics.newton_step());
    assert!(difference.abs() < 5e-4, "{difference}");
    for step in [0, 10, 20, 39] {
        let (found, expected) =
            (particles.smoothed_mean(step).unwrap(), exact.smoothed_mean(step).unwrap());
        assert!((found[0] - expected[0]).abs() < 0.03, "distance at {step}");
        assert!((found[1] - expected[1]).abs() < 0.02, "speed at {step}");
    }
}

#[test]
fn the_closed_form_m_step_maximises_q() {
    let window = window(2);
    let at = |coefficient: f64| WindowModel {
        window: &window,
        noise: &NOISE,
        share: coefficient / DEMAND,
        has_printed_cap: false,
    };
    let old = 0.05;
    let mut expectation = KalmanExpectation::new(STEPS);
    let maximum = old + DEMAND * expectation.expect(&at(old)).unwrap().newton_step();
    // Q as a function of the new coefficient, the states smoothed under the old one.
    let q = |coefficient: f64| -> f64 {
        (0..STEPS - 1)
            .map(|step| {
                let from = expectation.smoothed_mean(step).unwrap();
                let to = expectation.smoothed_mean(step + 1).unwrap();
                let (moved, _) = at(coefficient).advance(step, from);
                let [distance, speed] = MoveNoise::over(&NOISE, 0.2).precisions;
                -0.5 * (distance * (to[0] - moved[0]).powi(2) + speed * (to[1] - moved[1]).powi(2))
            })
            .sum()
    };
    // Golden-section search.
    let (mut low, mut high) = (0.0, 0.2);
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    while high - low > 1e-7 {
        let (left, right) = (high - golden * (high - low), low + golden * (high - low));
        if q(left) > q(right) {
            high = right;
        } else {
            low = left;
        }
    }
    assert!((maximum - 0.5 * (low + high)).abs() < 1e-6, "{maximum} instead of {low}");
}

#[test]
fn the_iterations_converge_to_the_maximum_likelihood_of_the_window() {
    let many = EmSettings { iterations: 3000, tolerance: 1e-13, ..model(0.02) };
    let found = estimate(many, KalmanExpectation::new(STEPS), 4);
    // The same window with the coefficient as a constant state, hardly known beforehand.
    let mut tracker = Tracker::new(
        TrackerModel {
            law: BrakingLaw::Constant,
            noise: NOISE,
            walk: Walk::Scale(0.0),
            first_speed_std_mps: 0.1,
            prior: PriorScale::OfLaw(Uncertain::new(0.1, 10.0)),
        },
        0.0,
        0,
        false,
    );
    let observed = observed(4);
    tracker.start(&BrakingObservation { speed_mps: FIRST_MPS, ..observed[0] });
    for observation in &observed[1..] {
        tracker.step(&inputs(), observation).unwrap();
    }
    let exact = tracker.estimate().unwrap().coefficient;
    assert!((found.value - exact.value).abs() < 2e-5, "{found:?} instead of {exact:?}");
    assert!((found.std / exact.std - 1.0).abs() < 0.02, "{found:?} instead of {exact:?}");
}

#[test]
fn fifty_exact_iterations_converge_from_any_start() {
    let converged = EmSettings { iterations: 3000, tolerance: 1e-13, ..model(TRUTH) };
    let exact = estimate(converged, KalmanExpectation::new(STEPS), 5).value;
    for start in [0.0, 0.05, 0.12, 0.3, 1.0] {
        let found = estimate(model(start), KalmanExpectation::new(STEPS), 5).value;
        assert!((found - exact).abs() < 1e-6, "from {start}: {found} instead of {exact}");
    }
}

#[test]
fn fifty_iterations_with_twenty_particles_do_not_arrive_from_zero() {
    // Too few particles reach the measured states, and the smoother can only weight particles that the filter has
    // drawn; the windows after the first hide it, since each starts where the one before it ended.
    for seed in 0..5 {
        let found = estimate(model(0.0), ParticleExpectation::new(20, STEPS, seed), seed).value;
        assert!(found < 0.75 * TRUTH, "seed {seed}: {found}");
    }
}

#[test]
fn under_the_printed_cap_a_start_above_the_demand_never_moves() {
    let printed = EmSettings { has_printed_cap: true, ..model(0.12) };
    let stuck = estimate(printed, ParticleExpectation::new(20, STEPS, 1), 6);
    assert!((stuck.value - 0.12).abs() < 1e-15, "{stuck:?}");
    let free = estimate(model(0.12), ParticleExpectation::new(20, STEPS, 1), 6);
    assert!((free.value - TRUTH).abs() < 0.01, "{free:?}");
    let below = EmSettings { has_printed_cap: true, ..model(0.05) };
    let moved = estimate(below, ParticleExpectation::new(20, STEPS, 1), 6);
    assert!((moved.value - TRUTH).abs() < 0.01, "{moved:?}");
}

#[test]
fn equal_seeds_give_equal_bits_and_others_do_not() {
    let run = |seed| estimate(model(0.05), ParticleExpectation::new(20, STEPS, seed), 7).value;
    assert_eq!(run(1).to_bits(), run(1).to_bits());
    assert_ne!(run(1), run(2));
}

#[test]
fn an_observation_that_no_particle_explains_is_a_failure() {
    let mut em = EmWindow::new(model(0.05), NOISE, ParticleExpectation::new(20, STEPS, 1));
    let observed = observed(8);
    em.start(&observed[0]);
    for observation in &observed[1..STEPS - 1] {
        em.step(&inputs(), observation).unwrap();
    }
    let lost = BrakingObservation { distance_m: f64::NAN, ..observed[STEPS - 1] };
    assert!(em.step(&inputs(), &lost).is_none());
}
