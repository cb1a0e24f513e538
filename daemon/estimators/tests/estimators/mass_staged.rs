//! Staged learning as in Wang 2022.

use std::sync::Arc;

use crate::mass_common::{
    Admitted, LEG, Simulation, assert_finite, feed, garbage, snapshot, train,
};
use dynocar_estimators::EstimatorSettings;
use dynocar_estimators::wang::force_model::LineResistance;
use dynocar_estimators::wang::{MassRegression, StagedDescent, StagedDescentSettings};
use dynocar_model::force::ResolvedSample;
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{Manoeuvre, PipelineKind, Reason, Status};

fn staged(settings: StagedDescentSettings) -> Admitted<StagedDescent> {
    let resistance = Davis { a: 1.0, b: 0.01, c: 0.0025 };
    let train = TrainModel { resistance, ..(*train()).clone() };
    Admitted::new(StagedDescent::new(settings, &Arc::new(train)).unwrap())
}

fn crossing(mass_kg: f64, seed: u64, legs: usize) -> Vec<ResolvedSample> {
    let mut simulation = Simulation::new(mass_kg, seed);
    let mut samples = Vec::new();
    for _ in 0..legs {
        samples.extend(simulation.drive(&LEG));
        samples.extend(simulation.stand(10.0));
    }
    samples
}

#[test]
fn the_normalised_descent_learns_the_basic_resistance() {
    let mut estimator = staged(StagedDescentSettings::default());
    feed(&mut estimator, &crossing(100_000.0, 1, 20));
    let basic = estimator.resistance().basic;
    for speed_mps in [6.0, 12.0, 20.0] {
        let error = basic.w0_n_per_kn(speed_mps) - train().resistance.w0_n_per_kn(speed_mps);
        assert!(error.abs() < 0.3, "{error} at {speed_mps}");
    }
    let snapshot = snapshot(&estimator);
    assert_eq!(
        (snapshot.status(), snapshot.reason()),
        (Status::Degraded, Some(Reason::TooFewSamples))
    );
    assert_eq!(estimator.mass_kg(), 100_000.0, "the last stage has not begun");
}

#[test]
fn force_on_acceleration_falls_short_and_the_reverse_does_not() {
    let known = LineResistance::declared(&train());
    let learn = |mass_regression, seed| {
        let mut estimator = staged(StagedDescentSettings { mass_regression, ..Default::default() });
        estimator.resume(&known);
        feed(&mut estimator, &Simulation::new(112_000.0, seed).drive(&LEG));
        let snapshot = snapshot(&estimator);
        assert_eq!(
            (snapshot.status(), snapshot.reason()),
            (Status::Degraded, Some(Reason::NotIdentifiable)),
            "the two directions differ by more than a mass may be trusted to"
        );
        100.0 * (estimator.mass_kg() / 112_000.0 - 1.0)
    };
    for seed in 0..10 {
        let short = learn(MassRegression::ForceOnAcceleration, seed);
        let even = learn(MassRegression::AccelerationOnForce, seed);
        assert!((-6.0..-2.0).contains(&short), "{short} %");
        assert!(even.abs() < 0.5, "{even} %");
    }
}

#[test]
fn a_stop_begins_the_mass_anew() {
    let mut estimator = staged(StagedDescentSettings {
        mass_regression: MassRegression::AccelerationOnForce,
        ..Default::default()
    });
    estimator.resume(&LineResistance::declared(&train()));
    feed(&mut estimator, &crossing(100_000.0, 3, 1));
    feed(&mut estimator, &Simulation::new(115_000.0, 4).drive(&LEG));
    assert!((estimator.mass_kg() / 115_000.0 - 1.0).abs() < 0.01, "{}", estimator.mass_kg());
}

#[test]
fn coasting_leaves_the_mass_of_the_last_stage_as_declared() {
    let mut estimator = staged(StagedDescentSettings::default());
    estimator.resume(&LineResistance::declared(&train()));
    let mut simulation = Simulation::new(140_000.0, 5);
    simulation.speed_mps = 20.0;
    feed(&mut estimator, &simulation.drive(&[(0.0, 60.0)]));
    assert_eq!(estimator.mass_kg(), 100_000.0);
    let snapshot = snapshot(&estimator);
    assert_eq!(snapshot.missing_manoeuvres, Manoeuvre::Accelerate.bit());
    assert_ne!(snapshot.status(), Status::Estimated);
}

#[test]
fn garbage_never_reaches_a_snapshot() {
    for seed in 0..10 {
        let settings = StagedDescentSettings { resistance_samples: 1_000, ..Default::default() };
        let mut estimator = staged(settings);
        for sample in garbage(seed, 2_000) {
            estimator.update(&sample);
            assert_finite(&snapshot(&estimator));
        }
    }
}

#[test]
fn settings_come_from_a_file_and_a_bad_one_is_named() {
    let text = "kind = \"staged_descent\"\nmass_regression = \"acceleration_on_force\"";
    let settings: EstimatorSettings = toml::from_str(text).unwrap();
    assert_eq!(settings.build(&train()).unwrap().kind(), PipelineKind::StagedDescent);
    let settings = StagedDescentSettings { rate: 2.5, ..Default::default() };
    let error = StagedDescent::new(settings, &train()).unwrap_err();
    assert_eq!(error.to_string(), "rate = 2.5: expected 0.001 to 1.9");
}
