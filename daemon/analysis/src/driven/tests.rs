//! The driven train compared with the open-loop prediction, and tested in situations that no recording has.

use dynocar_model::simulate::{OpenLoopRecording, Prediction, Restart};
use dynocar_model::track::{Track, TrackCurve};
use dynocar_model::train::Davis;

use super::*;
use dynocar_shared::TrainId;

const DAVIS: Davis = Davis { a: 1.5, b: 0.02, c: 0.004 };

/// Returns a train with several terms, none of which changes the measured speed.
fn updated_train() -> TrainModel {
    let mut train = TrainModel::bare("grown", 100e3, DAVIS);
    train.rotating_mass_factor = 0.06;
    train.length_m = 120.0;
    train.curve_constant_n_per_kn_m = 650.0;
    train.corrections.wind_plus_mps = 3.0;
    train.corrections.ambient_w0_per_k = -0.004;
    train.corrections.bearing_delta_a_n_per_kn = 0.8;
    train.corrections.traction_gain = 1.1;
    train
}

fn level() -> TrainModel {
    TrainModel::bare("level", 100e3, Davis { a: 0.0, b: 0.0, c: 0.0 })
}

/// Returns the acting forces after a time in s of a trip that ends with brakes.
fn acting(time_s: f64) -> TrainSample {
    let mut sample = TrainSample::empty(TrainId(1));
    sample.time_ns = (time_s * 1e9).round() as i64;
    sample.set(SampleField::TractionForce, if time_s < 60.0 { 80e3 - 500.0 * time_s } else { 0.0 });
    sample.set(SampleField::BrakeForce, if time_s < 90.0 { 0.0 } else { 70e3 });
    sample.set(SampleField::AmbientTemperature, -5.0);
    sample
}

fn train_at(train: TrainModel, track: Option<Track>, speed_mps: f64) -> DrivenTrain {
    let beginning = Beginning { position_m: 500.0, speed_mps, is_held_at_rest: true };
    DrivenTrain::new(Arc::new(train), track.map(Arc::new), beginning)
}

fn track() -> Track {
    let curves = vec![TrackCurve { start_m: 700.0, end_m: 1100.0, radius_m: 400.0 }];
    let gradient = [(0.0, 4.0), (900.0, -6.0)];
    Track::new("hill".into(), Some(9000.0), Some(&gradient), Some(curves), None).unwrap()
}

#[test]
fn a_train_driven_along_a_recording_goes_to_the_bit_as_is_predicted() {
    let train = Arc::new(updated_train());
    let track = Arc::new(track());
    let at = |k: usize| {
        let mut sample = acting(k as f64 * 0.2);
        sample.set(SampleField::Position, 500.0 + 2.5 * k as f64);
        sample.set(SampleField::Speed, 12.0);
        sample
    };
    let mut forces = ForceResolver::new(Arc::clone(&train), Some(Arc::clone(&track)));
    let resolved: Vec<_> = (0..700)
        .map(|k| forces.resolve(&ValidSample { sample: &at(k), step_s: 0.2, segment: 1 }))
        .collect();
    let recording = OpenLoopRecording::new(resolved).unwrap();
    let law = |k: usize, speed_mps: f64| {
        let forces = SampleForces::declared(&recording.samples()[k], train.rotating_mass_factor);
        let [p0, p1, p2] = forces.polynomial(train.resistance, speed_mps);
        p0 + speed_mps * (p1 + speed_mps * p2)
    };
    let mut prediction = Prediction::new();
    prediction.simulate(&recording, &law, Restart::FullRun);
    let mut driven = train_at(updated_train(), None, prediction.speed_mps()[0]);
    driven.forces = ForceResolver::new(train.clone(), Some(track));
    driven.look(&at(0));
    let mut fastest_mps = 0.0_f64;
    for (k, &predicted_mps) in prediction.speed_mps().iter().enumerate().skip(1) {
        let step_s = recording.time_s()[k] - recording.time_s()[k - 1];
        driven.drive(step_s, |at_s| at(if at_s == 0.0 { k - 1 } else { k }));
        assert_eq!(driven.speed_mps().to_bits(), predicted_mps.to_bits(), "at {k}");
        fastest_mps = fastest_mps.max(predicted_mps);
    }
    assert!(fastest_mps > 30.0 && driven.speed_mps() < 0.5 * fastest_mps, "{fastest_mps}");
}

#[test]
fn the_parts_are_the_whole() {
    let mut driven = train_at(updated_train(), Some(track()), 20.0);
    for k in 0..600 {
        driven.drive(0.1, |at_s| acting(f64::from(k) * 0.1 + at_s));
        let balance = driven.balance().unwrap();
        let part = |part: ForcePart| balance.force_n(part);
        let retarding_n: f64 = ForcePart::ALL[1..].iter().map(|&it| part(it)).sum();
        let force_n = part(ForcePart::Traction) - retarding_n;
        let by_parts = force_n / (1.06 * balance.mass_kg());
        assert!((by_parts - balance.acceleration_mps2()).abs() < 1e-9, "at {k}");
        let resistance_n: f64 = ForcePart::ALL[3..].iter().map(|&it| part(it)).sum();
        assert!((resistance_n - balance.resistance_n()).abs() < 1e-6, "at {k}");
    }
    let balance = driven.balance().unwrap();
    for part in [ForcePart::Wind, ForcePart::Ambient, ForcePart::Bearing] {
        assert!(balance.force_n(part) > 10.0, "{part:?}");
    }
}

#[test]
fn a_standing_train_waits_for_traction_and_nothing_pushes_it_back() {
    let falling = |traction_n: f64, brake_n: f64| {
        let mut sample = TrainSample::empty(TrainId(1));
        sample.set(SampleField::Gradient, -20.0);
        sample.set(SampleField::TractionForce, traction_n);
        sample.set(SampleField::BrakeForce, brake_n);
        sample
    };
    let after_10_s = |is_held_at_rest: bool, acting: TrainSample| {
        let mut driven = train_at(level(), None, 0.0);
        driven.is_held_at_rest = is_held_at_rest;
        driven.drive(10.0, |_| acting);
        let acceleration_mps2 = driven.balance().unwrap().acceleration_mps2();
        (driven.speed_mps(), driven.position_m(), acceleration_mps2)
    };
    assert_eq!(after_10_s(true, falling(0.0, 0.0)), (0.0, 500.0, 0.0), "held, reported or not");
    let (speed_mps, position_m, _) = after_10_s(false, falling(0.0, 0.0));
    assert!((speed_mps - 1.962).abs() < 1e-9, "nothing holds it: {speed_mps}");
    assert!((position_m - 509.81).abs() < 1e-9, "{position_m}");
    assert_eq!(after_10_s(false, falling(0.0, 90e3)), (0.0, 500.0, 0.0), "a brake does not push");
    let mut missing = falling(1e5, 0.0);
    missing.valid &= !(SampleField::Gradient.bit() | SampleField::BrakeForce.bit());
    let (speed_mps, ..) = after_10_s(true, missing);
    assert!((speed_mps - 10.0).abs() < 1e-9, "what is missing is none: {speed_mps}");
}

#[test]
fn a_train_towards_falling_chainage_goes_there_and_long_steps_are_divided() {
    let mut driven = train_at(level(), None, 10.0);
    let coasting = TrainSample { direction: -1, ..TrainSample::empty(TrainId(1)) };
    driven.drive(7.5, |_| coasting);
    assert!((driven.position_m() - 425.0).abs() < 1e-9);
    driven.drive(0.0, |_| coasting);
    assert_eq!((driven.speed_mps(), driven.measured_speed_mps()), (10.0, 10.0));
    let (mut short, mut long) = (
        train_at(updated_train(), Some(track()), 30.0),
        train_at(updated_train(), Some(track()), 30.0),
    );
    (0..30).for_each(|k| short.drive(1.0, |at_s| acting(f64::from(k) + at_s)));
    long.drive(30.0, acting);
    assert!((short.speed_mps() - long.speed_mps()).abs() < 1e-9);
}

#[test]
fn a_late_sensor_shows_the_speed_later_and_moves_nothing() {
    let late = |speed_delay_s| {
        let corrections = Corrections { speed_delay_s, ..Corrections::NONE };
        train_at(TrainModel { corrections, ..level() }, None, 0.0)
    };
    let (mut on_time, mut behind) = (late(0.0), late(0.8));
    let mut shown = Vec::new();
    for k in 0..200 {
        let begin_s = 0.2 * f64::from(k);
        for train in [&mut on_time, &mut behind] {
            train.drive(0.2, |at_s| acting(begin_s + at_s));
        }
        assert_eq!(on_time.speed_mps(), behind.speed_mps());
        shown.push((on_time.measured_speed_mps(), behind.measured_speed_mps()));
    }
    assert!(shown[199].0 > 1.0);
    for pair in shown.windows(5) {
        assert!((pair[4].1 - pair[0].0).abs() < 1e-9, "{pair:?}");
    }
}
