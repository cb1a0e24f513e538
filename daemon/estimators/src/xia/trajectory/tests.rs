//! The two pipelines over simulated runs, with good and bad input, and the simulated runs of this module's tests.

use std::sync::Arc;

use dynocar_core::pipeline::admission::Admission;
use dynocar_core::pipeline::{Estimator, Outcome};
use dynocar_model::force::{ResolvedSample, mps2_per_n_per_kn};
use dynocar_model::train::{BrakeGear, Davis, TrainModel};
use dynocar_shared::{
    Manoeuvre, ParameterSnapshot, PipelineKind, Reason, RejectionReason, Status, TrainId,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::kalman::TrajectoryKalmanSettings;
use super::motion::tests::sample;
use super::step::{StepRule, TrajectoryStep};
use crate::EstimatorSettings;
use crate::xia::newton::{FitMethod, TrajectoryNewton, TrajectoryNewtonSettings};

/// A high-speed train.
pub const FAST: Davis = Davis { a: 0.79, b: 0.0229, c: 0.001493 };
/// A metro.
pub const METRO: Davis = Davis { a: 1.5, b: 0.02, c: 0.0012 };

pub fn random(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// Returns a standard normal number, by Box and Muller.
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.random::<f64>()).cos()
}

/// Returns steps of traction, coasting and braking between 10 and 80 m/s over rolling ground.
pub fn steps(rule: StepRule, count: usize) -> Vec<TrajectoryStep> {
    (0..count)
        .map(|i| {
            let phase = [0.38, 0.2, 0.12, 0.0, -0.25, 0.25, 0.15, 0.0][(8 * i / count) % 8];
            TrajectoryStep {
                size: if rule == StepRule::Distance { 100.0 } else { 2.5 },
                drive_mps2: phase + 0.05 * (0.7 * i as f64).sin(),
                resistance_gain: mps2_per_n_per_kn(0.06),
            }
        })
        .collect()
}

/// Returns the speeds along steps, by the rule itself.
pub fn speeds(
    rule: StepRule,
    steps: &[TrajectoryStep],
    davis: &Davis,
    initial_mps: f64,
) -> Vec<f64> {
    let mut speeds = vec![initial_mps];
    for step in steps {
        let last_mps = speeds[speeds.len() - 1];
        speeds.push(rule.advance(step, davis, last_mps).expect("a moving train").speed_mps);
    }
    speeds
}

/// Returns the samples of a metro at 5 Hz: start, traction, coasting, braking, a stop of 20 s, and again.
///
/// `disturbance` is the root of the density of a white disturbing acceleration, in m/s² √s.
pub fn metro(
    davis: impl Fn(f64) -> Davis,
    seconds: u32,
    noise_mps: f64,
    disturbance: f64,
    seed: u64,
) -> Vec<ResolvedSample> {
    let mut random = random(seed);
    let mut speed_mps: f64 = 0.0;
    let mut samples = Vec::new();
    let force_at = |time_s: f64| match time_s % 160.0 {
        t if t < 30.0 => 70_000.0,
        t if t < 60.0 => 12_000.0,
        t if t < 110.0 => 0.0,
        _ => -70_000.0,
    };
    for index in 0..5 * seconds {
        let time_s = 0.2 * f64::from(index);
        let force_n = force_at(time_s);
        let measured_mps = (speed_mps + noise_mps * normal(&mut random)).max(0.0);
        samples.push(sample(index, measured_mps, force_n));
        // The force changes linearly to the next sample's, as the tracker takes it.
        let next_force_n = force_at(time_s + 0.2);
        let resistance_n = 981.0 * davis(time_s).w0_n_per_kn(speed_mps);
        let pull_n = 0.5 * (force_n + next_force_n) - resistance_n;
        speed_mps += 0.2 * pull_n / 1.06e5 + disturbance * 0.2_f64.sqrt() * normal(&mut random);
        speed_mps = speed_mps.max(0.0);
    }
    samples
}

/// Returns the metro as declared: every coefficient is wrong by a fifth.
fn train() -> Arc<TrainModel> {
    Arc::new(TrainModel {
        name: "metro".into(),
        mass_kg: 1e5,
        length_m: 120.0,
        cars: 6,
        full_mass_kg: None,
        passenger_mass_kg: 70.0,
        rotating_mass_factor: 0.06,
        resistance: Davis { a: 1.2 * METRO.a, b: 0.8 * METRO.b, c: 1.2 * METRO.c },
        curve_constant_n_per_kn_m: 600.0,
        tunnel_constant_n_per_kn_m: 0.0,
        traction: None,
        brake: None,
        drive: None,
        brake_gear: BrakeGear::default(),
        corrections: Default::default(),
        extra: Vec::new(),
    })
}

fn both() -> [EstimatorSettings; 2] {
    [PipelineKind::TrajectoryNewton, PipelineKind::TrajectoryKalman]
        .map(|kind| EstimatorSettings::default_of(kind).unwrap())
}

fn feed(estimator: &mut dyn Estimator, samples: &[ResolvedSample]) -> ParameterSnapshot {
    fed(estimator, samples, RejectionReason::Missing, |_| {}).0
}

/// Returns the last snapshot and the number of samples refused for a reason; looks at each snapshot.
fn fed(
    estimator: &mut dyn Estimator,
    samples: &[ResolvedSample],
    reason: RejectionReason,
    look: impl Fn(&ParameterSnapshot),
) -> (ParameterSnapshot, usize) {
    let mut admission = Admission::new(TrainId(1), train());
    let (mut snapshot, mut refused) = (ParameterSnapshot::empty(), 0);
    admission.write(estimator, &mut snapshot);
    for sample in samples {
        refused += usize::from(admission.pass(estimator, sample) == Outcome::Rejected(reason));
        admission.write(estimator, &mut snapshot);
        look(&snapshot);
    }
    (snapshot, refused)
}

fn assert_finite(snapshot: &ParameterSnapshot) {
    assert!(snapshot.values.iter().chain(&snapshot.covariance).all(|value| value.is_finite()));
    for value in [
        snapshot.innovation_normalised,
        snapshot.innovation_mean_square,
        snapshot.innovation_correlation,
        snapshot.unexplained_force_n,
        snapshot.unexplained_force_std_n,
        snapshot.speed_min_mps,
        snapshot.speed_max_mps,
    ] {
        assert!(value.is_finite());
    }
}

#[test]
fn both_pipelines_learn_the_resistance_of_a_metro_that_stops_on_the_way() {
    let samples = metro(|_| METRO, 1600, 0.02, 5e-4, 1);
    for (settings, tolerance) in both().iter().zip([0.15, 0.06]) {
        let mut estimator = settings.build(&train()).unwrap();
        assert_eq!(estimator.kind(), settings.kind());
        let snapshot = feed(&mut *estimator, &samples);
        assert_finite(&snapshot);
        let (low, high) = (snapshot.speed_min_mps, snapshot.speed_max_mps);
        assert!(low < 2.0 && high > 15.0, "{low} {high}");
        for speed_mps in [5.0, 10.0, 15.0] {
            let estimate = snapshot.resistance_at(speed_mps).unwrap();
            let error = estimate.w0_n_per_kn - METRO.w0_n_per_kn(speed_mps);
            let std = estimate.w0_std_n_per_kn;
            assert!(error.abs() < tolerance, "{:?} {speed_mps}: {error}", settings.kind());
            assert!(error.abs() < 4.0 * std, "{:?} {speed_mps}: {error} {std}", settings.kind());
        }
    }
}

#[test]
fn the_kalman_pipeline_follows_a_jump_that_the_window_forgets() {
    let rain = |time_s: f64| {
        let factor = if time_s > 1000.0 { 1.5 } else { 1.0 };
        Davis { a: factor * METRO.a, b: factor * METRO.b, c: factor * METRO.c }
    };
    let mut estimator = TrajectoryKalmanSettings::default().build(&train()).unwrap();
    let snapshot = feed(&mut estimator, &metro(rain, 1600, 0.02, 5e-4, 2));
    let estimate = snapshot.resistance_at(12.0).unwrap();
    let error = estimate.w0_n_per_kn - rain(1600.0).w0_n_per_kn(12.0);
    assert!(error.abs() < 0.1, "{error}");
    let age_s = estimator.filter().likeliest().age_s;
    assert!(age_s < 620.0, "the jump is dated: {age_s}");
}

#[test]
fn speeds_off_by_half_a_metre_per_second_are_left_out_and_counted() {
    let mut samples = metro(|_| METRO, 1600, 0.02, 5e-4, 3);
    let clean = feed(&mut TrajectoryKalmanSettings::default().build(&train()).unwrap(), &samples);
    let mut estimator = TrajectoryKalmanSettings::default().build(&train()).unwrap();
    for (index, sample) in samples.iter_mut().enumerate() {
        if index % 50 == 25 && sample.speed_mps > 3.0 {
            sample.speed_mps += 0.5;
        }
    }
    let (snapshot, refused) = fed(&mut estimator, &samples, RejectionReason::Outlier, |_| {});
    assert!(refused > 60, "{refused}");
    for speed_mps in [5.0, 15.0] {
        let apart = snapshot.resistance_at(speed_mps).unwrap().w0_n_per_kn
            - clean.resistance_at(speed_mps).unwrap().w0_n_per_kn;
        assert!(apart.abs() < 0.05, "{apart}");
    }
}

#[test]
fn before_any_data_the_declared_values_stand_with_their_prior() {
    for settings in both() {
        let mut estimator = settings.build(&train()).unwrap();
        let snapshot = feed(&mut *estimator, &[]);
        assert_eq!(snapshot.status(), Status::Unestimated);
        assert_eq!(snapshot.reason(), Some(Reason::TooFewSamples));
        assert_eq!(snapshot.values[0], train().resistance.a);
        assert_eq!(snapshot.excited, 0);
        assert_ne!(snapshot.missing_manoeuvres & Manoeuvre::Move.bit(), 0);
    }
}

#[test]
fn missing_forces_and_gradients_are_refused_and_named() {
    let samples = metro(|_| METRO, 60, 0.02, 0.0, 4);
    for settings in both() {
        for (without_gradient, reason) in
            [(true, Reason::GradientUnknown), (false, Reason::MissingQuantity)]
        {
            let mut estimator = settings.build(&train()).unwrap();
            let mut samples = samples.clone();
            for sample in &mut samples {
                if without_gradient {
                    sample.gradient_permille = None;
                } else {
                    sample.brake_force_n = None;
                }
            }
            let (snapshot, refused) =
                fed(&mut *estimator, &samples, RejectionReason::Missing, |_| {});
            assert!(refused > 200, "{refused}");
            assert_eq!(snapshot.status(), Status::Unestimated);
            assert_eq!(snapshot.reason(), Some(reason));
        }
    }
}

#[test]
fn numbers_that_are_none_never_reach_a_snapshot() {
    let mut samples = metro(|_| METRO, 400, 0.02, 5e-4, 5);
    for (index, sample) in samples.iter_mut().enumerate() {
        match index % 97 {
            10 => sample.speed_mps = f64::NAN,
            20 => sample.traction_force_n = Some(f64::INFINITY),
            30 => sample.gradient_permille = Some(f64::NAN),
            40 => sample.inertial_mass_kg = 0.0,
            50 => sample.step_s = f64::NAN,
            60 => sample.segment += 1,
            70 => sample.is_sliding = true,
            _ => {}
        }
    }
    for settings in both() {
        let mut estimator = settings.build(&train()).unwrap();
        fed(&mut *estimator, &samples, RejectionReason::Missing, assert_finite);
    }
}

#[test]
fn the_papers_method_runs_in_the_window_and_is_reproducible() {
    let samples = metro(|_| METRO, 800, 0.02, 0.0, 6);
    let settings = TrajectoryNewtonSettings {
        method: FitMethod::WolfeNewton,
        interval_m: 20.0,
        mean_square_max: 1e-3,
        ..TrajectoryNewtonSettings::default()
    };
    let run = || feed(&mut TrajectoryNewton::new(&settings, &train()).unwrap(), &samples);
    let snapshot = run();
    assert_eq!(snapshot, run());
    assert_finite(&snapshot);
    let estimate = snapshot.resistance_at(12.0).unwrap();
    assert!((estimate.w0_n_per_kn - METRO.w0_n_per_kn(12.0)).abs() < 1.0);
}

#[test]
fn a_setting_out_of_range_is_refused_by_name() {
    let refused = |settings: TrajectoryKalmanSettings| settings.build(&train()).unwrap_err().key;
    let default = TrajectoryKalmanSettings::default();
    assert_eq!(refused(TrajectoryKalmanSettings { hypotheses: 0, ..default }), "hypotheses");
    let noise = TrajectoryKalmanSettings { speed_noise_mps: Some(-1.0), ..default };
    assert_eq!(refused(noise), "speed_noise_mps");
    let evidence = TrajectoryKalmanSettings { jump_evidence: f64::NAN, ..default };
    assert_eq!(refused(evidence), "jump_evidence");
    let refused = |settings: TrajectoryNewtonSettings| {
        TrajectoryNewton::new(&settings, &train()).unwrap_err().key
    };
    let default = TrajectoryNewtonSettings::default();
    assert_eq!(refused(TrajectoryNewtonSettings { window: 2, ..default }), "window");
    let crossed = TrajectoryNewtonSettings { high: Some([-1.0, 1.0, 1.0]), ..default };
    assert_eq!(refused(crossed), "high");
}

#[test]
fn settings_are_read_by_name_and_unknown_names_are_refused() {
    let read = |text: &str| toml::from_str::<EstimatorSettings>(text);
    let settings = read("kind = \"trajectory_newton\"\nmethod = \"wolfe_newton\"").unwrap();
    assert_eq!(settings.kind(), PipelineKind::TrajectoryNewton);
    assert!(read("kind = \"trajectory_kalman\"\nhypotheses = 4").is_ok());
    assert!(read("kind = \"trajectory_kalman\"\nhypothesis = 4").is_err());
}

/// Returns a train that holds a speed, within 1 m/s of it, over 20 minutes.
fn cruise(seed: u64) -> Vec<ResolvedSample> {
    let mut random = random(seed);
    let mut speed_mps = 15.0;
    let force_at = |time_s: f64| {
        let wave = 9_000.0 * (std::f64::consts::TAU * time_s / 60.0).cos();
        981.0 * METRO.w0_n_per_kn(15.0) + wave
    };
    (0..6_000)
        .map(|index| {
            let time_s = 0.2 * f64::from(index);
            let measured_mps = speed_mps + 0.02 * normal(&mut random);
            let taken = sample(index, measured_mps, force_at(time_s));
            let force_n = 0.5 * (force_at(time_s) + force_at(time_s + 0.2));
            let pull_n = force_n - 981.0 * METRO.w0_n_per_kn(speed_mps);
            speed_mps += 0.2 * pull_n / 1.06e5 + 5e-4 * 0.2_f64.sqrt() * normal(&mut random);
            taken
        })
        .collect()
}

#[test]
fn in_cruise_the_resistance_there_may_be_used_although_its_coefficients_are_not_distinguished() {
    const SEEDS: u64 = 30;
    let mut held = 0;
    for seed in 0..SEEDS {
        let mut estimator = TrajectoryKalmanSettings::default().build(&train()).unwrap();
        let snapshot = feed(&mut estimator, &cruise(seed));
        let said = (snapshot.status(), snapshot.reason());
        assert_eq!(said, (Status::Estimated, Some(Reason::WeakExcitation)), "seed {seed}");
        let there = snapshot.resistance_at(15.0).unwrap();
        let normalised = (there.w0_n_per_kn - METRO.w0_n_per_kn(15.0)) / there.w0_std_n_per_kn;
        assert!(normalised.abs() < 4.0, "seed {seed}: {normalised} standard deviations off");
        held += u64::from(normalised.abs() < 1.96);
        let elsewhere = snapshot.resistance_at(40.0).unwrap();
        assert!(elsewhere.is_extrapolated && !there.is_extrapolated);
        assert!(elsewhere.w0_std_n_per_kn > 3.0 * there.w0_std_n_per_kn);
    }
    // 95 % of 30; 24 or fewer would come by chance once in 500 times.
    assert!(held > 24, "{held} of {SEEDS} intervals of 95 % hold the truth");
}
