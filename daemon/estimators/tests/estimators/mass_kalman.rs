//! Mass by Kalman filters: estimates, the time that they take, and the effect of bad input.

use crate::mass_common::{
    Admitted, LEG, Simulation, assert_finite, feed, garbage, snapshot, train,
};
use dynocar_core::pipeline::Outcome;
use dynocar_estimators::EstimatorSettings;
use dynocar_estimators::wang::{MassKalman, MassKalmanSettings};
use dynocar_model::force::ResolvedSample;
use dynocar_shared::{Manoeuvre, Parameter, PipelineKind, Reason, RejectionReason, Status};

fn estimator() -> Admitted<MassKalman> {
    with(MassKalmanSettings::default())
}

fn with(settings: MassKalmanSettings) -> Admitted<MassKalman> {
    Admitted::new(MassKalman::new(settings, &train()).unwrap())
}

fn error(estimator: &MassKalman, truth_kg: f64) -> f64 {
    estimator.mass_kg().0 / truth_kg - 1.0
}

#[test]
fn one_leg_gives_the_mass_within_a_tenth_of_a_percent() {
    for seed in 0..20 {
        let mut estimator = estimator();
        feed(&mut estimator, &Simulation::new(113_000.0, seed).drive(&LEG));
        let (mass_kg, std_kg) = estimator.mass_kg();
        assert!((mass_kg / 113_000.0 - 1.0).abs() < 1e-3, "seed {seed}: {mass_kg}");
        assert!((mass_kg - 113_000.0).abs() < 4.0 * std_kg, "seed {seed}: {mass_kg} ± {std_kg}");
        let snapshot = snapshot(&estimator);
        assert_eq!((snapshot.status(), snapshot.reason()), (Status::Estimated, Some(Reason::None)));
        assert_eq!(snapshot.missing_manoeuvres, 0);
        assert!((snapshot.value(Parameter::Mass).unwrap() - 1e-3 * mass_kg).abs() < 1e-9);
    }
}

#[test]
fn a_train_that_only_coasts_learns_nothing_of_its_mass_and_says_so() {
    let mut estimator = estimator();
    let before = estimator.mass_kg();
    let mut simulation = Simulation::new(150_000.0, 1);
    simulation.speed_mps = 25.0;
    feed(&mut estimator, &simulation.drive(&[(0.0, 120.0)]));
    assert_eq!(estimator.mass_kg(), before);
    let snapshot = snapshot(&estimator);
    assert_eq!(snapshot.status(), Status::Unestimated);
    assert_eq!(snapshot.reason(), Some(Reason::WeakExcitation));
    assert_eq!(snapshot.missing_manoeuvres, Manoeuvre::Accelerate.bit());
    assert_eq!(snapshot.excited & 1, 0);
}

#[test]
fn the_mass_stays_while_the_train_coasts_after_traction() {
    let mut estimator = estimator();
    let mut simulation = Simulation::new(120_000.0, 2);
    feed(&mut estimator, &simulation.drive(&[(80_000.0, 20.0)]));
    // The force takes a second to fall.
    let (falling, coasting) = (simulation.drive(&[(0.0, 1.4)]), simulation.drive(&[(0.0, 40.0)]));
    feed(&mut estimator, &falling);
    let before = estimator.mass_kg();
    for sample in &coasting {
        assert_eq!(estimator.update(sample), Outcome::Used);
        assert_eq!(estimator.mass_kg(), before);
    }
    assert_eq!(snapshot(&estimator).status(), Status::Estimated);
}

#[test]
fn a_stop_opens_the_mass_and_the_new_one_is_found_in_thirty_seconds_of_traction() {
    for seed in 0..20 {
        let mut estimator = estimator();
        let mut simulation = Simulation::new(100_000.0, seed);
        feed(&mut estimator, &simulation.drive(&LEG));
        feed(&mut estimator, &simulation.stand(20.0));
        let closed_std = estimator.mass_kg().1;
        simulation.mass_kg = 112_000.0;
        let leg = simulation.drive(&[(70_000.0, 30.0)]);
        let first_moving = leg.iter().position(|sample| sample.speed_mps > 0.3).unwrap();
        feed(&mut estimator, &leg[..=first_moving]);
        let open_std = estimator.mass_kg().1;
        assert!(closed_std < 1_000.0 && open_std > 9_000.0, "{closed_std}, then {open_std}");
        let open = snapshot(&estimator);
        assert_eq!(
            (open.status(), open.reason()),
            (Status::Degraded, Some(Reason::WeakExcitation))
        );
        feed(&mut estimator, &leg[first_moving + 1..]);
        assert!(
            error(&estimator, 112_000.0).abs() < 0.01,
            "seed {seed}: {:?}",
            estimator.mass_kg()
        );
        assert_eq!(snapshot(&estimator).status(), Status::Estimated);
    }
}

#[test]
fn a_signal_stop_of_seconds_and_a_train_that_is_never_loaded_keep_the_mass() {
    let never = MassKalmanSettings { mass_change_std_percent: 0.0, ..Default::default() };
    for (settings, stop_s) in [(MassKalmanSettings::default(), 3.0), (never, 60.0)] {
        let mut estimator = with(settings);
        let mut simulation = Simulation::new(100_000.0, 4);
        feed(&mut estimator, &simulation.drive(&LEG));
        let before = estimator.mass_kg();
        feed(&mut estimator, &simulation.stand(stop_s));
        let first = simulation.drive(&[(80_000.0, 1.0)]);
        feed(&mut estimator, &first);
        assert_eq!(estimator.mass_kg(), before);
    }
}

#[test]
fn a_declared_mass_that_changes_at_a_stop_is_followed() {
    let mut estimator = estimator();
    let mut simulation = Simulation::new(100_000.0, 5);
    feed(&mut estimator, &simulation.drive(&LEG));
    feed(&mut estimator, &simulation.stand(20.0));
    simulation.mass_kg = 130_000.0;
    let mut loaded = simulation.drive(&LEG);
    for sample in &mut loaded {
        sample.mass_kg = 128_000.0;
    }
    let departs = loaded.iter().position(|sample| sample.speed_mps > 0.3).unwrap();
    feed(&mut estimator, &loaded[..=departs]);
    assert!(error(&estimator, 128_000.0).abs() < 2e-3, "{:?}", estimator.mass_kg());
    feed(&mut estimator, &loaded[departs + 1..]);
    assert!(error(&estimator, 130_000.0).abs() < 1e-3, "{:?}", estimator.mass_kg());
}

#[test]
fn unknown_constant_forces_are_distinguished_from_mass() {
    for extra_n_per_kn in [-1.5, 1.0, 2.0] {
        let mut estimator = estimator();
        let mut simulation = Simulation::new(108_000.0, 6);
        simulation.extra_n_per_kn = extra_n_per_kn;
        feed(&mut estimator, &simulation.drive(&LEG));
        assert!(error(&estimator, 108_000.0).abs() < 2e-3, "{:?}", estimator.mass_kg());
        let snapshot = snapshot(&estimator);
        let expected_n = extra_n_per_kn * 9.81 * 108.0;
        assert!((snapshot.unexplained_force_n - expected_n).abs() < 0.1 * expected_n.abs());
    }
}

#[test]
fn a_force_that_jumps_between_samples_leaves_the_mass_within_its_interval() {
    for seed in 0..20 {
        let mut estimator = estimator();
        let mut simulation = Simulation::new(92_000.0, seed);
        simulation.slew_n_per_s = f64::INFINITY;
        // Held after each sample, instead of running straight to the next.
        let mut leg = simulation.drive(&LEG);
        for i in (1..leg.len()).rev() {
            leg[i].traction_force_n = leg[i - 1].traction_force_n;
            leg[i].brake_force_n = leg[i - 1].brake_force_n;
        }
        feed(&mut estimator, &leg);
        let (mass_kg, std_kg) = estimator.mass_kg();
        assert!((mass_kg / 92_000.0 - 1.0).abs() < 0.01, "seed {seed}: {mass_kg}");
        assert!((mass_kg - 92_000.0).abs() < 4.0 * std_kg, "seed {seed}: {mass_kg} ± {std_kg}");
    }
}

#[test]
fn outliers_and_coarse_digits_leave_the_mass_within_its_interval() {
    for seed in 0..20 {
        let (mut with_outliers, mut coarse) = (estimator(), estimator());
        let mut simulation = Simulation::new(95_000.0, seed);
        simulation.outlier_share = 0.05;
        feed(&mut with_outliers, &simulation.drive(&LEG));
        assert!(error(&with_outliers, 95_000.0).abs() < 2e-3, "{:?}", with_outliers.mass_kg());
        let mut simulation = Simulation::new(95_000.0, seed);
        simulation.quantum_mps = 1.0 / 3.6;
        feed(&mut coarse, &simulation.drive(&LEG));
        assert!(error(&coarse, 95_000.0).abs() < 1e-2, "{:?}", coarse.mass_kg());
    }
}

#[test]
fn samples_without_force_are_refused_and_bridged_and_complained_of_when_none_has_one() {
    let mut estimator = estimator();
    let mut simulation = Simulation::new(104_000.0, 7);
    let mut leg = simulation.drive(&LEG);
    for sample in leg.iter_mut().skip(20).step_by(5) {
        sample.traction_force_n = None;
    }
    let refused = leg
        .iter()
        .filter(|sample| estimator.update(sample) == Outcome::Rejected(RejectionReason::Missing))
        .count();
    assert!(refused > 50);
    assert!(error(&estimator, 104_000.0).abs() < 5e-3, "{:?}", estimator.mass_kg());

    let mut starved = self::estimator();
    leg.iter_mut().for_each(|sample| sample.gradient_permille = None);
    feed(&mut starved, &leg);
    let snapshot = snapshot(&starved);
    assert_eq!(snapshot.status(), Status::Unestimated);
    assert_eq!(snapshot.reason(), Some(Reason::GradientUnknown));
}

#[test]
fn a_sliding_wheel_is_refused_and_a_gap_starts_the_speed_anew() {
    let mut estimator = estimator();
    let mut simulation = Simulation::new(104_000.0, 8);
    let mut first = simulation.drive(&[(80_000.0, 20.0)]);
    first[60].is_sliding = true;
    first[60].speed_mps += 3.0;
    let outcomes: Vec<Outcome> = first.iter().map(|sample| estimator.update(sample)).collect();
    assert_eq!(outcomes[60], Outcome::Rejected(RejectionReason::WheelSlide));
    assert_eq!(outcomes[61], Outcome::Used, "nothing to compare with");
    simulation.gap(4.0);
    simulation.speed_mps -= 2.0;
    let second = simulation.drive(&[(60_000.0, 20.0)]);
    assert!(second.iter().all(|sample| !matches!(estimator.update(sample), Outcome::Rejected(_))));
    assert!(error(&estimator, 104_000.0).abs() < 5e-3);
}

#[test]
fn garbage_never_reaches_a_snapshot() {
    for seed in 0..30 {
        let mut estimator = estimator();
        for sample in garbage(seed, 2_000) {
            estimator.update(&sample);
            assert_finite(&snapshot(&estimator));
        }
    }
}

#[test]
fn the_same_samples_give_the_same_bits() {
    let samples: Vec<ResolvedSample> = Simulation::new(99_000.0, 9).drive(&LEG);
    let (mut one, mut other) = (estimator(), estimator());
    feed(&mut one, &samples);
    feed(&mut other, &samples);
    assert_eq!(snapshot(&one), snapshot(&other));
}

#[test]
fn settings_come_from_a_file_and_a_bad_one_is_named() {
    let text = "kind = \"mass_kalman\"\nbias_std_mps2 = 0.02\nbasic_resistance = [2.0, 0.0, 0.005]";
    let settings: EstimatorSettings = toml::from_str(text).unwrap();
    assert_eq!(settings.kind(), PipelineKind::MassKalman);
    assert_eq!(settings.build(&train()).unwrap().kind(), PipelineKind::MassKalman);
    assert!(toml::from_str::<EstimatorSettings>("kind = \"mass_kalman\"\nbias = 1.0").is_err());
    let settings = MassKalmanSettings { mass_std_percent: f64::NAN, ..Default::default() };
    let error = MassKalman::new(settings, &train()).unwrap_err();
    assert_eq!(error.to_string(), "mass_std_percent = NaN: expected 0.1 to 50");
}
