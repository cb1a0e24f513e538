//! The open-loop simulation against closed-form solutions, and at gaps, stops, outliers and restarts.

use dynocar_shared::resistance::GRAVITY_MPS2;
use proptest::prelude::*;

use super::recording::tests::{coasting_sample, recorded};
use super::*;
use crate::force::ResolvedSample;
use crate::train::Davis;

const DAVIS: Davis = Davis { a: 1.5, b: 0.02, c: 0.004 };

/// Returns the speed after coasting for `time_s` from `start_mps`: the Riccati equation
/// dv/dt = -(p + q v + r v²) with 4 p r > q² has v = (w tan(phi0 - w t / 2) - q) / (2 r), where
/// w = sqrt(4 p r - q²) and tan(phi0) = (2 r v0 + q) / w.
fn coasted_speed_mps(davis: Davis, gradient_permille: f64, start_mps: f64, time_s: f64) -> f64 {
    let per_inertia = GRAVITY_MPS2 / 1000.0 / 1.06;
    let (p, q, r) =
        (per_inertia * (davis.a + gradient_permille), per_inertia * davis.b, per_inertia * davis.c);
    let w = (4.0 * p * r - q * q).sqrt();
    let phase = ((2.0 * r * start_mps + q) / w).atan() - 0.5 * w * time_s;
    // Beyond -phi_rest the train has come to rest.
    if phase <= (q / w).atan() { 0.0 } else { (w * phase.tan() - q) / (2.0 * r) }
}

fn greatest_difference_mps(step_s: f64) -> f64 {
    let count = (400.0 / step_s) as usize;
    let samples = (0..count)
        .map(|k| ResolvedSample {
            speed_mps: 60.0,
            gradient_permille: Some(2.5),
            ..coasting_sample(k as f64 * step_s)
        })
        .collect();
    let recording = recorded(samples);
    let mut prediction = Prediction::new();
    let model = QuadraticForces::declared(&recording, DAVIS);
    prediction.simulate(&recording, &model, Restart::FullRun);
    let differences = prediction
        .speed_mps()
        .iter()
        .zip(recording.time_s())
        .map(|(speed, &time_s)| (speed - coasted_speed_mps(DAVIS, 2.5, 60.0, time_s)).abs());
    differences.fold(0.0, f64::max)
}

#[test]
fn coasting_follows_the_closed_form_to_rest() {
    assert_eq!(coasted_speed_mps(DAVIS, 2.5, 60.0, 2000.0), 0.0);
    // (step in s, greatest difference in m/s); the error falls with the square of the step.
    for (step_s, tolerance_mps) in [(0.1, 1e-6), (0.2, 4e-6), (1.0, 1e-4)] {
        let difference = greatest_difference_mps(step_s);
        assert!(difference < tolerance_mps, "step {step_s} s: {difference} m/s");
    }
    let order = (greatest_difference_mps(1.0) / greatest_difference_mps(0.5)).log2();
    assert!((order - 2.0).abs() < 0.1, "order {order}");
}

#[test]
fn coasting_comes_to_rest_and_stays() {
    let samples = (0..6000).map(|k| coasting_sample(k as f64 * 0.2)).collect();
    let recording = recorded(samples);
    let mut prediction = Prediction::new();
    let model = QuadraticForces::declared(&recording, DAVIS);
    prediction.simulate(&recording, &model, Restart::FullRun);
    let stop = prediction.speed_mps().iter().position(|&speed| speed == 0.0).unwrap();
    let start_mps = recording.samples()[0].speed_mps;
    let before_s = recording.time_s()[stop - 1];
    assert!(coasted_speed_mps(DAVIS, 0.0, start_mps, before_s) > 0.0);
    assert!(coasted_speed_mps(DAVIS, 0.0, start_mps, before_s + 0.4) == 0.0);
    assert!(prediction.speed_mps()[stop..].iter().all(|&speed| speed == 0.0));
}

#[test]
fn forces_between_samples_are_linear_in_time() {
    // Without resistance the speed is the integral of the force: exact by trapezoids.
    let times_s = [0.0, 0.3, 0.5, 1.7, 5.0];
    let force_n = [0.0, 40e3, 90e3, 20e3, 60e3];
    let samples = times_s
        .iter()
        .zip(force_n)
        .map(|(&time_s, force)| ResolvedSample {
            traction_force_n: Some(force),
            ..coasting_sample(time_s)
        })
        .collect();
    let recording = recorded(samples);
    let model = QuadraticForces::declared(&recording, Davis { a: 0.0, b: 0.0, c: 0.0 });
    let mut prediction = Prediction::new();
    prediction.simulate(&recording, &model, Restart::FullRun);
    let impulse_ns: f64 =
        (1..5).map(|i| 0.5 * (times_s[i] - times_s[i - 1]) * (force_n[i] + force_n[i - 1])).sum();
    let expected_mps = recording.samples()[0].speed_mps + impulse_ns / 106_000.0;
    assert!((prediction.speed_mps()[4] - expected_mps).abs() < 1e-12);
}

#[test]
fn a_held_train_leaves_when_traction_beats_brake_and_gradient() {
    // The brake falls and traction rises linearly over one step of 1 s; the acceleration
    // passes zero after 0.6 s and is 0.4 m/s² at its end.
    let mass_kg = 106_000.0;
    let forces_n = [(0.0, 0.6 * mass_kg), (0.4 * mass_kg, 0.0)];
    let samples = forces_n
        .iter()
        .enumerate()
        .map(|(k, &(traction, brake))| ResolvedSample {
            speed_mps: 0.0,
            traction_force_n: Some(traction),
            brake_force_n: Some(brake),
            ..coasting_sample(k as f64)
        })
        .collect();
    let recording = recorded(samples);
    let model = QuadraticForces::declared(&recording, Davis { a: 0.0, b: 0.0, c: 0.0 });
    let mut prediction = Prediction::new();
    prediction.simulate(&recording, &model, Restart::FullRun);
    assert!((prediction.speed_mps()[1] - 0.5 * 0.4 * 0.4).abs() < 1e-12);
}

#[test]
fn kinetic_energy_changes_by_the_work_of_all_forces() {
    let samples: Vec<_> = (0..3000)
        .map(|k| {
            let time_s = k as f64 * 0.2;
            ResolvedSample {
                traction_force_n: Some(40e3 * (1.0 + (0.05 * time_s).sin())),
                brake_force_n: Some(10e3 * (1.0 + (0.031 * time_s).cos())),
                gradient_permille: Some(12.0 * (0.02 * time_s).sin()),
                ..coasting_sample(time_s)
            }
        })
        .collect();
    let recording = recorded(samples);
    let model = QuadraticForces::declared(&recording, DAVIS);
    let mut prediction = Prediction::new();
    prediction.simulate(&recording, &model, Restart::FullRun);
    let speeds = prediction.speed_mps();
    let inertia_kg = recording.samples()[0].inertial_mass_kg;
    let mut work_j = 0.0;
    let mut turnover_j = 0.0;
    for i in 1..speeds.len() {
        let power = |k: usize| inertia_kg * model.acceleration_mps2(k, speeds[k]) * speeds[k];
        work_j += 0.5 * 0.2 * (power(i - 1) + power(i));
        turnover_j += 0.5 * 0.2 * (power(i - 1) + power(i)).abs();
    }
    let end = speeds[speeds.len() - 1];
    let gained_j = 0.5 * inertia_kg * (end * end - speeds[0] * speeds[0]);
    assert!(speeds.iter().all(|&speed| speed > 1.0), "no stop in this case");
    assert!((gained_j - work_j).abs() < 1e-5 * turnover_j, "{gained_j} J against {work_j} J");
}

#[test]
fn a_speed_scale_acts_on_what_is_measured_only() {
    let recording = recorded((0..500).map(|k| coasting_sample(k as f64 * 0.2)).collect());
    let mut model = QuadraticForces::default();
    let declared = recording.samples().iter().map(|sample| declared_polynomial(sample, DAVIS));
    model.restart(1.02);
    model.extend(declared);
    let mut prediction = Prediction::new();
    prediction.simulate(&recording, &model, Restart::FullRun);
    let start_mps = recording.samples()[0].speed_mps;
    assert_eq!(prediction.speed_mps()[0], start_mps);
    let true_mps = coasted_speed_mps(DAVIS, 0.0, start_mps / 1.02, recording.time_s()[499]);
    assert!((prediction.speed_mps()[499] - 1.02 * true_mps).abs() < 1e-5);
}

fn predict(recording: &OpenLoopRecording, restart: Restart) -> Prediction {
    let mut prediction = Prediction::new();
    let model = QuadraticForces::declared(recording, DAVIS);
    prediction.simulate(recording, &model, restart);
    prediction
}

/// Returns a run that the declared model predicts exactly, at 5 Hz.
fn perfect_run(count: usize) -> Vec<ResolvedSample> {
    let pulled = |k: usize| ResolvedSample {
        traction_force_n: Some(30e3 + 20e3 * (k as f64 * 0.01).sin()),
        ..coasting_sample(k as f64 * 0.2)
    };
    let recording = recorded((0..count).map(pulled).collect());
    let prediction = predict(&recording, Restart::FullRun);
    let speeds = prediction.speed_mps().iter();
    speeds.enumerate().map(|(k, &speed_mps)| ResolvedSample { speed_mps, ..pulled(k) }).collect()
}

fn rmse_mps(recording: &OpenLoopRecording, restart: Restart) -> f64 {
    SpeedError::new(recording, &predict(recording, restart)).rmse_mps().unwrap()
}

#[test]
fn missing_rows_are_bridged_by_longer_steps() {
    let mut samples = perfect_run(1000);
    samples.retain(|sample| {
        let row = sample.time_ns / 200_000_000;
        !(200..240).contains(&row) && row % 7 != 3
    });
    let recording = recorded(samples);
    assert_eq!(recording.restarts(), 0);
    // Over the 8 s without rows the force bends away from a straight line by 2 % of its swing of
    // 20 kN: 0.02 m/s.
    assert!(rmse_mps(&recording, Restart::FullRun) < 0.03);
}

#[test]
fn missing_forces_are_interpolated_over_a_short_gap() {
    let mut samples = perfect_run(1000);
    for sample in &mut samples[300..306] {
        sample.traction_force_n = None;
    }
    let recording = recorded(samples);
    assert_eq!((recording.bridged(), recording.restarts()), (6, 0));
    assert!(rmse_mps(&recording, Restart::FullRun) < 1e-4);
}

#[test]
fn a_long_gap_of_forces_is_left_out_and_the_speed_taken_up_after_it() {
    let mut samples = perfect_run(1000);
    for sample in &mut samples[300..400] {
        sample.brake_force_n = None;
        // The forces do not show the time between.
        sample.speed_mps += 3.0;
    }
    for sample in &mut samples[400..] {
        sample.speed_mps += 1.0;
    }
    let recording = recorded(samples);
    assert_eq!((recording.bridged(), recording.restarts()), (0, 1));
    assert!(!recording.is_simulated(350) && recording.is_simulated(400));
    let prediction = predict(&recording, Restart::FullRun);
    assert_eq!(prediction.speed_mps()[400], recording.samples()[400].speed_mps);
    assert_eq!(SpeedError::new(&recording, &prediction).count, 900);
}

#[test]
fn windows_start_at_the_measured_speed_and_end_after_their_length() {
    let mut samples = perfect_run(1000);
    // A speed 0.5 m/s too high from the second window on.
    for sample in &mut samples[300..] {
        sample.speed_mps += 0.5;
    }
    let recording = recorded(samples);
    let prediction = predict(&recording, Restart::WINDOW_60);
    for window_start in [300, 600, 900] {
        let measured_mps = recording.samples()[window_start].speed_mps;
        assert_eq!(prediction.speed_mps()[window_start], measured_mps);
    }
    let measured_mps = recording.samples()[299].speed_mps;
    assert!((prediction.speed_mps()[299] - measured_mps).abs() < 1e-12);
    assert!(rmse_mps(&recording, Restart::WINDOW_60) < rmse_mps(&recording, Restart::FullRun));
}

#[test]
fn an_outlier_at_the_start_is_replaced_by_what_follows() {
    let mut samples = perfect_run(200);
    let true_mps = samples[0].speed_mps;
    samples[0].speed_mps = 61.0;
    let recording = recorded(samples);
    let prediction = predict(&recording, Restart::FullRun);
    assert!((prediction.speed_mps()[0] - true_mps).abs() < 1e-4);
    let mut noisy = perfect_run(200);
    noisy[0].speed_mps += 0.3;
    let kept_mps = noisy[0].speed_mps;
    assert_eq!(predict(&recorded(noisy), Restart::FullRun).speed_mps()[0], kept_mps);
}

#[test]
fn a_stop_on_a_falling_gradient_is_held_without_a_reported_brake() {
    let stop_and_go = |k: usize| {
        let (speed_mps, traction, brake) = match k {
            0..100 => (10.0, 0.0, 0.0),
            100..400 => (0.0, 0.0, 0.0),
            _ => (5.0, 60e3, 0.0),
        };
        // The brake acts until the predicted train stands, whenever the measured one did.
        let brake = if (80..120).contains(&k) { 250e3 } else { brake };
        ResolvedSample {
            speed_mps,
            traction_force_n: Some(traction),
            brake_force_n: Some(brake),
            gradient_permille: Some(-9.0),
            ..coasting_sample(k as f64 * 0.2)
        }
    };
    let recording = recorded((0..420).map(stop_and_go).collect());
    let prediction = predict(&recording, Restart::FullRun);
    assert!(prediction.speed_mps()[150..399].iter().all(|&speed| speed == 0.0));
    assert!(prediction.speed_mps()[419] > 1.0);
}

#[test]
fn a_run_without_forces_or_order_is_refused() {
    let bare = ResolvedSample { brake_force_n: None, ..coasting_sample(0.0) };
    let refused = OpenLoopRecording::new(vec![bare]);
    assert_eq!(refused, Err(SimulateError::NoForces { samples: 1 }));
    let backwards = vec![coasting_sample(1.0), coasting_sample(0.5)];
    assert!(matches!(
        OpenLoopRecording::new(backwards),
        Err(SimulateError::TimeNotIncreasing { index: 1, .. })
    ));
}

#[test]
fn an_unknown_gradient_counts_as_level_and_is_said() {
    let unknown =
        |k: usize| ResolvedSample { gradient_permille: None, ..coasting_sample(k as f64 * 0.2) };
    let recording = recorded((0..50).map(unknown).collect());
    assert!(!recording.knows_gradient());
    let level = recorded((0..50).map(|k| coasting_sample(k as f64 * 0.2)).collect());
    assert!(level.knows_gradient());
    assert_eq!(predict(&recording, Restart::FullRun), predict(&level, Restart::FullRun));
}

proptest! {
    #[test]
    fn predictions_are_finite_and_never_negative(
        forces in prop::collection::vec((0.0f64..2e5, 0.0f64..3e5), 2..60),
        gaps_s in prop::collection::vec(0.001f64..9.0, 60),
        gradient in -40.0f64..40.0,
        start in 0.0f64..90.0,
        c in -0.5f64..0.5,
    ) {
        let mut time_s = 0.0;
        let samples = forces.iter().zip(&gaps_s).map(|(&(traction, brake), gap)| {
            time_s += gap;
            ResolvedSample {
                speed_mps: start,
                traction_force_n: Some(traction),
                brake_force_n: Some(brake),
                gradient_permille: Some(gradient),
                ..coasting_sample(time_s)
            }
        }).collect();
        let recording = recorded(samples);
        let model = QuadraticForces::declared(&recording, Davis { c, ..DAVIS });
        let mut prediction = Prediction::new();
        for restart in [Restart::FullRun, Restart::WINDOW_60] {
            prediction.simulate(&recording, &model, restart);
            prop_assert!(prediction.speed_mps().iter().all(|&v| (0.0..=motion::SPEED_MAX_MPS).contains(&v)));
        }
    }
}
