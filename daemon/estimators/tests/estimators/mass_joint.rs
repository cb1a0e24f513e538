//! Resistance and mass by joint least squares.

use crate::mass_common::{
    Admitted, LEG, Simulation, assert_finite, feed, garbage, snapshot, train,
};
use dynocar_core::pipeline::Outcome;
use dynocar_estimators::EstimatorSettings;
use dynocar_estimators::wang::known_motion::LearningSet;
use dynocar_estimators::wang::{JointLeastSquares, JointLeastSquaresSettings};
use dynocar_model::force::ResolvedSample;
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{Manoeuvre, Parameter, PipelineKind, Reason, RejectionReason, Status};
use std::sync::Arc;

/// A train that declares half of its true resistance.
fn badly_declared() -> Arc<TrainModel> {
    let resistance = Davis { a: 1.0, b: 0.01, c: 0.0025 };
    Arc::new(TrainModel { resistance, ..(*train()).clone() })
}

fn estimator() -> Admitted<JointLeastSquares> {
    let settings = JointLeastSquaresSettings::default();
    Admitted::new(JointLeastSquares::new(settings, &badly_declared()).unwrap())
}

/// Legs of different loads with stops between them.
fn legs(simulation: &mut Simulation, masses_kg: &[f64]) -> Vec<ResolvedSample> {
    let mut samples = Vec::new();
    for &mass_kg in masses_kg {
        simulation.mass_kg = mass_kg;
        samples.extend(simulation.drive(&LEG));
        samples.extend(simulation.stand(10.0));
    }
    samples
}

#[test]
fn resistance_and_changing_masses_are_found_together() {
    for seed in 0..5 {
        let mut estimator = estimator();
        let mut simulation = Simulation::new(100_000.0, seed);
        feed(&mut estimator, &legs(&mut simulation, &[100e3, 112e3, 95e3, 104e3]));
        let (mass_kg, std_kg) = estimator.mass_kg().unwrap();
        assert!((mass_kg / 104e3 - 1.0).abs() < 2e-3, "seed {seed}: {mass_kg}");
        assert!((mass_kg - 104e3).abs() < 4.0 * std_kg);
        let basic = estimator.resistance().unwrap().basic;
        for speed_mps in [8.0, 14.0, 20.0] {
            let error = basic.w0_n_per_kn(speed_mps) - train().resistance.w0_n_per_kn(speed_mps);
            assert!(error.abs() < 0.06, "seed {seed}: {error} at {speed_mps}");
        }
        let snapshot = snapshot(&estimator);
        assert_eq!((snapshot.status(), snapshot.reason()), (Status::Estimated, Some(Reason::None)));
        let estimate = snapshot.resistance_at(14.0).unwrap();
        assert!((estimate.w0_n_per_kn - basic.w0_n_per_kn(14.0)).abs() < 1e-9);
        assert!(estimate.w0_std_n_per_kn > 0.0 && estimate.w0_std_n_per_kn < 0.1);
    }
}

#[test]
fn curve_and_tunnel_resistance_are_functions_of_speed() {
    let mut estimator = estimator();
    let mut simulation = Simulation::new(100_000.0, 3);
    // Legs alternate between open track, a curve of 500 m and a tunnel.
    for round in 0..9 {
        let (extra, curvature, share) =
            [(0.0, 0.0, 0.0), (1.2, 1.0 / 500.0, 0.0), (3.0, 0.0, 1.0)][round % 3];
        simulation.extra_n_per_kn = extra;
        let mut leg = simulation.drive(&LEG);
        for sample in &mut leg {
            sample.curvature_per_m = Some(curvature);
            sample.tunnel_share = Some(share);
        }
        feed(&mut estimator, &leg);
        feed(&mut estimator, &simulation.stand(10.0));
    }
    let resistance = estimator.resistance().unwrap();
    for speed_mps in [8.0, 14.0, 20.0] {
        let curve = resistance.curve.unwrap().w0_n_per_kn(speed_mps);
        let tunnel = resistance.tunnel.unwrap().w0_n_per_kn(speed_mps);
        assert!((curve - 1.2).abs() < 0.12, "{curve} at {speed_mps}");
        assert!((tunnel - 3.0).abs() < 0.12, "{tunnel} at {speed_mps}");
    }
    let covariance = estimator.resistance_covariance(LearningSet::Tunnel).unwrap();
    assert!(covariance.cholesky().is_some());
}

#[test]
fn coasting_teaches_resistance_and_no_mass() {
    let mut estimator = estimator();
    let mut simulation = Simulation::new(150_000.0, 4);
    simulation.speed_mps = 28.0;
    feed(&mut estimator, &simulation.drive(&[(0.0, 400.0)]));
    let (mass_kg, std_kg) = estimator.mass_kg().unwrap();
    assert!((mass_kg / 100e3 - 1.0).abs() < 1e-6, "as declared");
    assert!((std_kg / mass_kg / 0.2 - 1.0).abs() < 0.1, "as at the start: {std_kg}");
    let snapshot = snapshot(&estimator);
    assert_eq!(
        (snapshot.status(), snapshot.reason()),
        (Status::Degraded, Some(Reason::WeakExcitation))
    );
    assert_eq!(
        snapshot.missing_manoeuvres & Manoeuvre::Accelerate.bit(),
        Manoeuvre::Accelerate.bit()
    );
    let w = snapshot.resistance_at(15.0).unwrap().w0_n_per_kn;
    assert!((w - train().resistance.w0_n_per_kn(15.0)).abs() < 0.1, "{w}");
}

#[test]
fn before_it_has_moved_nothing_is_claimed() {
    let snapshot = snapshot(&estimator());
    assert_eq!(
        (snapshot.status(), snapshot.reason()),
        (Status::Unestimated, Some(Reason::TooFewSamples))
    );
    assert_eq!(snapshot.value(Parameter::Mass), Some(100.0));
    assert_eq!(snapshot.excited, 0);
}

#[test]
fn outliers_gaps_and_missing_forces_are_refused_and_survived() {
    let mut estimator = estimator();
    let mut simulation = Simulation::new(100_000.0, 5);
    simulation.outlier_share = 0.03;
    let mut samples = legs(&mut simulation, &[100e3, 108e3]);
    simulation.gap(4.0);
    samples.extend(legs(&mut simulation, &[104e3]));
    for sample in samples.iter_mut().step_by(7) {
        sample.brake_force_n = None;
    }
    let mut counts = [0, 0];
    for sample in &samples {
        match estimator.update(sample) {
            Outcome::Rejected(RejectionReason::Outlier) => counts[0] += 1,
            Outcome::Rejected(RejectionReason::Missing) => counts[1] += 1,
            _ => {}
        }
    }
    assert!(counts[0] > 20 && counts[1] > 100, "{counts:?}");
    let (mass_kg, _) = estimator.mass_kg().unwrap();
    assert!((mass_kg / 104e3 - 1.0).abs() < 5e-3, "{mass_kg}");
}

#[test]
fn garbage_never_reaches_a_snapshot() {
    for seed in 0..10 {
        let mut estimator = estimator();
        for sample in garbage(seed, 2_000) {
            estimator.update(&sample);
            assert_finite(&snapshot(&estimator));
        }
    }
}

#[test]
fn settings_come_from_a_file_and_a_bad_one_is_named() {
    let text = "kind = \"joint_least_squares\"\nmass_std_percent = 5";
    let settings: EstimatorSettings = toml::from_str(text).unwrap();
    assert_eq!(settings.build(&train()).unwrap().kind(), PipelineKind::JointLeastSquares);
    let settings = JointLeastSquaresSettings { speed_noise_mps: 0.0, ..Default::default() };
    let error = JointLeastSquares::new(settings, &train()).unwrap_err();
    assert_eq!(error.to_string(), "speed_noise_mps = 0: expected 0.001 to 1");
}
