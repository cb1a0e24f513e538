//! The estimator across a restart of the daemon and with brakes that do not act as reported.

use std::sync::Arc;

use dynocar_model::force::ResolvedSample;
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::snapshot::packed_index;
use dynocar_shared::{ParameterSnapshot, Quantity, Reason, Status, TrainId};
use rand::{RngExt, SeedableRng};

use super::{TrainKalman, TrainKalmanSettings};
use crate::pipeline::admission::Admission;
use crate::pipeline::{Estimator, KeptEstimate};

/// Drives a train of 100 t declared and 110 t true for a time, and returns the answer.
fn driven(estimator: &mut TrainKalman, from_s: u32, duration_s: u32) -> ParameterSnapshot {
    braked(estimator, from_s, duration_s, (1.0, 0.1))
}

/// The same with a brake that exerts a share of the force that it reports, and releases with a time constant in s.
fn braked(
    estimator: &mut TrainKalman,
    from_s: u32,
    duration_s: u32,
    (share, release_s): (f64, f64),
) -> ParameterSnapshot {
    let (w0, gain) = (2.0, 9.806_65e-3 / 1.06);
    // The traction makes up for the brake that is still being released.
    let traction = 40.0 * (1.0 + release_s / 15.0);
    let push = |second: f64| -> f64 { [traction, 0.0, -40.0, 0.0][(second / 15.0) as usize % 4] };
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(u64::from(from_s));
    let (mut speed_mps, mut brake) = (20.0, 0.0);
    let (mut admission, mut snapshot) = (admission(), ParameterSnapshot::empty());
    for tick in 10 * from_s..10 * (from_s + duration_s) {
        let second = 0.1 * f64::from(tick);
        let reported = share * (-push(second)).max(0.0);
        brake = reported.max(brake + 0.1 / release_s * (reported - brake));
        let force = (push(second).max(0.0) - brake) / 1.1;
        speed_mps += 0.1 * gain * (force - w0);
        let coasting = ResolvedSample::coasting();
        let sample = ResolvedSample {
            time_ns: i64::from(tick) * 100_000_000,
            step_s: 0.1,
            speed_mps: speed_mps + 0.07 * (random.random::<f64>() - 0.5),
            traction_force_n: Some(push(second).max(0.0) * coasting.weight_kn),
            brake_force_n: Some((-push(second)).max(0.0) * coasting.weight_kn),
            ..coasting
        };
        admission.pass(estimator, &sample);
        admission.write(estimator, &mut snapshot);
    }
    snapshot
}

fn train() -> Arc<TrainModel> {
    let davis = Davis { a: 1.8, b: 0.0, c: 0.0 };
    let train = TrainModel { rotating_mass_factor: 0.06, ..TrainModel::bare("t", 100e3, davis) };
    Arc::new(train)
}

fn admission() -> Admission {
    Admission::new(TrainId(1), train())
}

fn estimator() -> TrainKalman {
    TrainKalman::new(TrainKalmanSettings::default(), &train()).unwrap()
}

#[test]
fn after_a_restart_the_mass_and_the_resistance_are_known_with_the_first_seconds() {
    let mut first = estimator();
    let before = driven(&mut first, 0, 300);
    assert_eq!(before.status(), Status::Estimated);
    assert!((before.values[3] / 110.0 - 1.0).abs() < 0.01, "{}", before.values[3]);
    let kept = KeptEstimate::from_snapshot(&before).unwrap().after(2.0);
    let mut cold = estimator();
    assert_eq!(driven(&mut cold, 300, 5).status(), Status::Unestimated);
    let mut warm = estimator();
    assert!(warm.warm_start(&kept));
    let after = driven(&mut warm, 300, 5);
    assert_eq!(after.status(), Status::Estimated, "{:?}", after.reason());
    let std = |it: &ParameterSnapshot, i: usize| it.covariance[packed_index(i, i)].sqrt();
    for i in [0, 3] {
        assert!((after.values[i] - before.values[i]).abs() < 2.0 * std(&before, i), "{i}");
    }
    assert!(std(&after, 0) < 1.5 * std(&before, 0));
    // Between the two somebody may have boarded.
    assert!(std(&after, 3) < 0.015 * after.values[3]);
}

#[test]
fn what_was_in_use_goes_on_with_the_first_sample_unless_minutes_have_passed() {
    const BOTH: u32 = Quantity::Resistance.bit() | Quantity::Mass.bit();
    let mut before = driven(&mut estimator(), 0, 300);
    (before.sample_time_ns, before.usable_quantities) = (300_000_000_000, BOTH);
    let first = |after_s: i64, elapsed_s: f64, speed_mps: f64| {
        let mut warm = estimator();
        assert!(warm.warm_start(&KeptEstimate::from_snapshot(&before).unwrap().after(elapsed_s)));
        let time_ns = (300 + after_s) * 1_000_000_000;
        let sample = ResolvedSample { time_ns, speed_mps, ..ResolvedSample::coasting() };
        let (mut admission, mut snapshot) = (admission(), ParameterSnapshot::empty());
        admission.pass(&mut warm, &sample);
        let known = admission.write(&warm, &mut snapshot);
        let std_t = snapshot.covariance[packed_index(3, 3)].sqrt();
        (snapshot.status(), known.unwrap_or(0) & BOTH, std_t)
    };
    let std_t = before.covariance[packed_index(3, 3)].sqrt();
    let (status, known, moving_t) = first(3, 2.5, 15.0);
    assert_eq!((status, known), (Status::Estimated, BOTH));
    assert!((moving_t / std_t - 1.0).abs() < 0.01, "{moving_t} t, before {std_t} t");
    let (status, known, standing_t) = first(12, 12.0, 0.0);
    assert_eq!((status, known), (Status::Estimated, BOTH));
    assert!((4.0..10.0).contains(&standing_t), "somebody may have boarded: {standing_t} t");
    assert!(first(40, 40.0, 15.0).2 > 4.0, "it may have stopped meanwhile");
    for (after_s, elapsed_s) in [(700, 700.0), (3, 700.0), (-20, 3.0)] {
        let (status, known, _) = first(after_s, elapsed_s, 15.0);
        assert_eq!((status, known), (Status::Unestimated, 0), "{after_s} s, {elapsed_s} s");
    }
}

#[test]
fn a_mass_that_is_known_before_the_resistance_outlives_a_restart() {
    let mut before = driven(&mut estimator(), 0, 10);
    let reason = before.reason();
    assert_eq!((before.status(), reason), (Status::Unestimated, Some(Reason::WeakExcitation)));
    (before.sample_time_ns, before.usable_quantities) = (10_000_000_000, Quantity::Mass.bit());
    let kept = KeptEstimate::from_snapshot(&before).unwrap();
    let mut warm = estimator();
    assert!(warm.warm_start(&kept.after(1.5)));
    let sample = ResolvedSample { time_ns: 11_000_000_000, ..ResolvedSample::coasting() };
    let (mut admission, mut snapshot) = (admission(), ParameterSnapshot::empty());
    admission.pass(&mut warm, &sample);
    assert_eq!(admission.write(&warm, &mut snapshot), Some(Quantity::Mass.bit()));
    let std_t = |it: &ParameterSnapshot| it.covariance[packed_index(3, 3)].sqrt();
    assert!((snapshot.values[3] / before.values[3] - 1.0).abs() < 1e-3);
    assert!(std_t(&snapshot) < 1.05 * std_t(&before), "{} t", std_t(&snapshot));
}

#[test]
fn a_brake_that_exerts_less_than_reported_leaves_the_mass_right() {
    for share in [0.9, 0.5] {
        let mut estimator = estimator();
        driven(&mut estimator, 0, 120);
        let after = braked(&mut estimator, 120, 300, (share, 0.1));
        let mass_t = after.values[3];
        assert!((mass_t / 110.0 - 1.0).abs() < 0.01, "{share}: {mass_t}");
    }
}

#[test]
fn a_brake_that_releases_slowly_as_by_air_leaves_the_mass_right() {
    for release_s in [3.0, 5.0, 8.0] {
        let after = braked(&mut estimator(), 0, 900, (1.0, release_s));
        let (mass_t, std_t) = (after.values[3], after.covariance[packed_index(3, 3)].sqrt());
        assert!(
            (mass_t - 110.0).abs() < 2.0 * std_t && std_t < 2.0,
            "{release_s}: {mass_t} {std_t}"
        );
        assert_eq!(after.status(), Status::Estimated);
    }
}

#[test]
fn a_mass_that_the_train_cannot_have_is_doubted() {
    let answer = |tare_t: f64, full_t: f64| {
        let train = TrainModel {
            mass_kg: 1e3 * tare_t,
            full_mass_kg: Some(1e3 * full_t),
            ..TrainModel::clone(&train())
        };
        let mut estimator =
            TrainKalman::new(TrainKalmanSettings::default(), &Arc::new(train)).unwrap();
        let after = driven(&mut estimator, 0, 300);
        assert!((after.values[3] / 110.0 - 1.0).abs() < 0.02, "{}", after.values[3]);
        (after.status(), after.reason())
    };
    assert_eq!(answer(100.0, 140.0), (Status::Estimated, Some(Reason::None)));
    assert_eq!(answer(80.0, 104.0).0, Status::Estimated, "a little crowded");
    // Forces of some of the motors, or in another unit.
    assert_eq!(answer(140.0, 180.0), (Status::Degraded, Some(Reason::AtBound)));
}
