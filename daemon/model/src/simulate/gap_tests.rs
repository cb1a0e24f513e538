//! Gaps, stops, outliers and restarts in the open-loop simulation.

use super::recording::tests::{coasting_sample, recorded};
use super::*;
use crate::force::ResolvedSample;
use crate::train::Davis;

const DAVIS: Davis = Davis { a: 1.5, b: 0.02, c: 0.004 };

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
