use dynocar_core::pipeline::braking::settings::{
    BrakeFactor, EkfSettings, SmootherSettings, WalkSettings,
};
use dynocar_estimators::EstimatorSettings;
use dynocar_estimators::xie::{EStep, EmSettings};
use dynocar_shared::{Parameter, Reason, Status};

use super::simulation::{FULL_BRAKING, FULL_PRESSURE_PA, Run, after, pipeline};

/// The discs give a tenth less than declared.
const WORN: Run = Run { brake_factor: 0.9, ..FULL_BRAKING };

fn brake_settings(reports: BrakeFactor) -> [EstimatorSettings; 3] {
    [
        EstimatorSettings::BrakeEm(EmSettings { reports, ..Default::default() }),
        EstimatorSettings::BrakeEkf(EkfSettings { reports, ..Default::default() }),
        EstimatorSettings::BrakeSmoother(SmootherSettings { reports, ..Default::default() }),
    ]
}

#[test]
fn one_factor_is_reported_with_the_other_held_and_the_snapshot_says_so() {
    let cases = [
        (BrakeFactor::Friction, Parameter::DiscFriction, Parameter::BrakingRatio, 0.28),
        (BrakeFactor::Ratio, Parameter::BrakingRatio, Parameter::DiscFriction, 2.55),
    ];
    for (factor, reported, held, declared) in cases {
        for settings in brake_settings(factor) {
            let kind = settings.kind();
            let snapshot = after(&mut pipeline(&settings), &WORN.simulate(1));
            let value = snapshot.value(reported).expect("the reported factor");
            let std = snapshot.std(reported).unwrap();
            let truth = 0.9 * declared;
            assert!((value - truth).abs() < 4.0 * std, "{kind}: {value} ± {std}, not {truth}");
            assert!((value / truth - 1.0).abs() < 0.1, "{kind}: {value} instead of {truth}");
            assert_eq!(snapshot.value(held), None, "{kind} cannot know the held factor");
            assert_eq!(snapshot.status(), Status::Estimated);
            assert_eq!(snapshot.reason(), Some(Reason::NotIdentifiable));
        }
    }
}

#[test]
fn only_the_product_of_friction_and_ratio_is_known() {
    let moments = WORN.simulate(2);
    let product = |reports, parameter, held: f64| {
        // The same walk for both, so that only the reported factor differs.
        let walk = Some(WalkSettings::Scale { std_after_1_s: 0.004 });
        let settings = SmootherSettings { reports, walk, ..Default::default() };
        let snapshot = after(&mut pipeline(&EstimatorSettings::BrakeSmoother(settings)), &moments);
        held * snapshot.value(parameter).unwrap()
    };
    let by_friction = product(BrakeFactor::Friction, Parameter::DiscFriction, 2.55);
    let by_ratio = product(BrakeFactor::Ratio, Parameter::BrakingRatio, 0.28);
    assert!((by_friction / by_ratio - 1.0).abs() < 1e-9, "{by_friction}, {by_ratio}");
}

#[test]
fn the_start_does_not_matter_even_outside_the_range_of_the_papers() {
    let moments = WORN.simulate(3);
    let em = |reports, parameter, initial| {
        let settings = EmSettings {
            reports,
            initial: Some(initial),
            e_step: EStep::Kalman,
            ..Default::default()
        };
        after(&mut pipeline(&EstimatorSettings::BrakeEm(settings)), &moments)
            .value(parameter)
            .unwrap()
    };
    let friction = |initial| em(BrakeFactor::Friction, Parameter::DiscFriction, initial);
    for initial in [0.0, 0.15, 0.35, 0.40, 1.0] {
        assert!((friction(initial) - friction(0.28)).abs() < 1e-6, "friction from {initial}");
    }
    let ratio = |initial| em(BrakeFactor::Ratio, Parameter::BrakingRatio, initial);
    for initial in [0.0, 1.0, 3.0, 5.0, 10.0] {
        assert!((ratio(initial) - ratio(2.55)).abs() < 1e-5, "ratio from {initial}");
    }
}

#[test]
fn a_known_friction_curve_is_scaled() {
    let curve = vec![(0.0, 0.30), (40.0, 0.28), (90.0, 0.25)];
    // The simulated brake has the same friction at all speeds: 0.9 of 0.28.
    let settings = SmootherSettings {
        lag_s: 0.0,
        friction_law: Some(vec![(0.0, 0.28), (90.0, 0.28 + 1e-9)]),
        ..Default::default()
    };
    let snapshot =
        after(&mut pipeline(&EstimatorSettings::BrakeSmoother(settings)), &WORN.simulate(4));
    let value = snapshot.value(Parameter::DiscFriction).unwrap();
    assert!((value - 0.252).abs() < 0.004, "{value}");
    let ratio_with_curve = SmootherSettings {
        reports: BrakeFactor::Ratio,
        friction_law: Some(curve),
        ..Default::default()
    };
    let refused = EstimatorSettings::BrakeSmoother(ratio_with_curve)
        .build(&std::sync::Arc::new(super::simulation::train()));
    assert_eq!(refused.err().map(|error| error.key), Some("friction_law"));
}

#[test]
fn a_pressure_that_rises_slowly_does_not_disturb_the_friction() {
    let run =
        Run { pressure_pa: |time_s| FULL_PRESSURE_PA * (0.2 + time_s / 10.0).min(1.0), ..WORN };
    let causal = SmootherSettings { lag_s: 0.0, ..Default::default() };
    let mut pipeline = pipeline(&EstimatorSettings::BrakeSmoother(causal));
    for moment in run.simulate(5) {
        let snapshot = *pipeline.process(&moment.sample);
        if moment.time_s > 8.0 {
            let value = snapshot.value(Parameter::DiscFriction).unwrap();
            assert!((value / 0.252 - 1.0).abs() < 0.15, "{} s: {value}", moment.time_s);
        }
    }
}
