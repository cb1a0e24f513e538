use dynocar_core::pipeline::braking::settings::{
    BrakingSettings, EkfSettings, LawSettings, SmootherSettings,
};
use dynocar_estimators::EstimatorSettings;
use dynocar_estimators::xie::{EStep, EmSettings};
use dynocar_shared::{Parameter, PipelineKind, Reason, SampleField, Status};

use super::simulation::{DEMAND, FULL_BRAKING, FULL_PRESSURE_PA, Run, after, dry, pipeline, wet};

const WET: Run = Run { adhesion: |_, speed_mps| wet(speed_mps), ..FULL_BRAKING };

fn adhesion_settings() -> [EstimatorSettings; 4] {
    [
        EstimatorSettings::AdhesionEm(EmSettings::default()),
        EstimatorSettings::AdhesionEkf(EkfSettings::default()),
        EstimatorSettings::AdhesionSmoother(SmootherSettings::default()),
        EstimatorSettings::AdhesionLaw(LawSettings::default()),
    ]
}

#[test]
fn every_pipeline_finds_the_adhesion_of_a_wet_rail() {
    for settings in adhesion_settings() {
        let kind = settings.kind();
        let moments = WET.simulate(1);
        let snapshot = after(&mut pipeline(&settings), &moments);
        assert_eq!((snapshot.status(), snapshot.reason()), (Status::Estimated, Some(Reason::None)));
        let value = snapshot.value(Parameter::Adhesion).expect("adhesion");
        let std = snapshot.std(Parameter::Adhesion).unwrap();
        // The estimate of EM belongs to the middle of its window, the smoother's lies 5 s back.
        let back = match kind {
            PipelineKind::AdhesionEm => 22,
            PipelineKind::AdhesionSmoother => 25,
            _ => 0,
        };
        let truth = wet(moments[moments.len() - 1 - back].speed_mps);
        assert!((value - truth).abs() < 4.0 * std, "{kind}: {value} instead of {truth} ± {std}");
        assert!((value / truth - 1.0).abs() < 0.1, "{kind}: {value} instead of {truth}");
        assert!(std < 0.1 * truth, "{kind}: {std}");
    }
}

#[test]
fn where_the_brake_is_the_smaller_one_there_is_only_a_lower_bound() {
    for settings in adhesion_settings() {
        let kind = settings.kind();
        let run = Run { adhesion: |_, speed_mps| dry(speed_mps), ..FULL_BRAKING };
        let mut pipeline = pipeline(&settings);
        for moment in run.simulate(2) {
            let snapshot = *pipeline.process(&moment.sample);
            if moment.time_s > 12.0 {
                assert_eq!(snapshot.value(Parameter::Adhesion), None, "{kind} {}", moment.time_s);
                let bound = snapshot.value(Parameter::AdhesionLowerBound).expect("a bound");
                assert!((bound / DEMAND - 1.0).abs() < 0.1, "{kind}: {bound}");
                assert_eq!(snapshot.reason(), Some(Reason::OnlyLowerBound), "{kind}");
                assert_eq!(snapshot.status(), Status::Unestimated, "{kind}");
            }
        }
    }
}

#[test]
fn a_brake_that_is_applied_slowly_is_not_taken_for_low_adhesion() {
    let run = Run {
        adhesion: |_, speed_mps| dry(speed_mps),
        pressure_pa: |time_s| FULL_PRESSURE_PA * (0.2 + time_s / 15.0).min(1.0),
        ..FULL_BRAKING
    };
    let causal = SmootherSettings { lag_s: 0.0, ..Default::default() };
    let all = adhesion_settings().into_iter();
    for settings in all.chain([EstimatorSettings::AdhesionSmoother(causal)]) {
        let kind = settings.kind();
        let mut pipeline = pipeline(&settings);
        for moment in run.simulate(3) {
            let snapshot = *pipeline.process(&moment.sample);
            if snapshot.status() == Status::Estimated {
                panic!("{kind} gives a number at {} s: {snapshot:?}", moment.time_s);
            }
        }
    }
}

#[test]
fn a_brake_that_acts_behind_its_report_is_not_taken_for_low_adhesion() {
    let run = Run {
        adhesion: |_, speed_mps| dry(speed_mps),
        pressure_pa: |time_s| FULL_PRESSURE_PA * (1.0 - (-time_s / 1.5).exp()),
        ..FULL_BRAKING
    };
    let causal = SmootherSettings { lag_s: 0.0, ..Default::default() };
    let all = adhesion_settings().into_iter();
    for settings in all.chain([EstimatorSettings::AdhesionSmoother(causal)]) {
        let kind = settings.kind();
        let mut pipeline = pipeline(&settings);
        for mut moment in run.simulate(3) {
            moment.sample.valid &= !SampleField::BrakeCylinderPressure.bit();
            moment.sample.set(SampleField::BrakeForce, 494_973.0);
            let snapshot = *pipeline.process(&moment.sample);
            let at_s = moment.time_s;
            assert_ne!(snapshot.status(), Status::Estimated, "{kind} at {at_s} s: {snapshot:?}");
        }
    }
}

#[test]
fn the_start_does_not_matter_even_outside_the_range_of_the_papers() {
    let moments = WET.simulate(4);
    let em = |initial| {
        let settings =
            EmSettings { initial: Some(initial), e_step: EStep::Kalman, ..Default::default() };
        after(&mut pipeline(&EstimatorSettings::AdhesionEm(settings)), &moments)
            .value(Parameter::Adhesion)
            .unwrap()
    };
    let reference = em(0.08);
    for initial in [0.0, 0.03, 0.05, 0.09, 0.12, 0.3, 1.0] {
        let found = em(initial);
        assert!((found - reference).abs() < 1e-7, "from {initial}: {found}, not {reference}");
    }
    // The smoother and the law have no initial value; the filter forgets its own.
    let ekf = |initial| {
        let settings = EkfSettings { initial: Some(initial), ..Default::default() };
        after(&mut pipeline(&EstimatorSettings::AdhesionEkf(settings)), &moments)
            .value(Parameter::Adhesion)
            .unwrap()
    };
    for initial in [0.0, 0.12, 0.3] {
        assert!((ekf(initial) - ekf(0.08)).abs() < 1e-4, "from {initial}");
    }
}

#[test]
fn a_tunnel_portal_is_noticed_within_seconds() {
    // Dry for 15 s, then wet.
    let run = Run {
        adhesion: |time_s, speed_mps| {
            if time_s < 15.0 { dry(speed_mps) } else { 0.8 * wet(speed_mps) }
        },
        seconds: 35.0,
        ..FULL_BRAKING
    };
    let causal = SmootherSettings { lag_s: 0.0, ..Default::default() };
    for settings in [
        EstimatorSettings::AdhesionSmoother(causal),
        EstimatorSettings::AdhesionLaw(LawSettings::default()),
    ] {
        let kind = settings.kind();
        let mut pipeline = pipeline(&settings);
        for moment in run.simulate(5) {
            let snapshot = *pipeline.process(&moment.sample);
            let number = snapshot.value(Parameter::Adhesion);
            let is_believed = snapshot.status() == Status::Estimated;
            if moment.time_s < 15.0 {
                assert!(!is_believed, "{kind} gives a number at {} s", moment.time_s);
            } else if moment.time_s > 25.0 {
                let truth = 0.8 * wet(moment.speed_mps);
                let found = number.filter(|_| is_believed).expect("a number");
                assert!((found / truth - 1.0).abs() < 0.1, "{kind} {}: {found}", moment.time_s);
            }
        }
    }
}

#[test]
fn the_law_pipeline_reports_the_scale_of_the_law_that_holds() {
    let run = Run { adhesion: |_, speed_mps| 0.85 * wet(speed_mps), ..FULL_BRAKING };
    let settings = EstimatorSettings::AdhesionLaw(LawSettings::default());
    let snapshot = after(&mut pipeline(&settings), &run.simulate(6));
    let scale = snapshot.value(Parameter::AdhesionLawScale).unwrap();
    let std = snapshot.std(Parameter::AdhesionLawScale).unwrap();
    assert!((scale - 0.85).abs() < 4.0 * std && std < 0.03, "{scale} ± {std}");
    // Adhesion and scale are one quantity seen twice: fully correlated, but for the speed.
    let (adhesion, of_scale) = (
        snapshot.index_of(Parameter::Adhesion).unwrap(),
        snapshot.index_of(Parameter::AdhesionLawScale).unwrap(),
    );
    let adhesion_std = snapshot.std(Parameter::Adhesion).unwrap();
    let correlation = snapshot.covariance_at(adhesion, of_scale) / (adhesion_std * std);
    assert!((0.9..1.0 + 1e-9).contains(&correlation), "{correlation}");
}

#[test]
fn without_a_pressure_the_reported_brake_force_is_the_demand() {
    let mut moments = WET.simulate(7);
    for moment in &mut moments {
        moment.sample.valid &= !SampleField::BrakeCylinderPressure.bit();
        moment.sample.set(SampleField::BrakeForce, 494_973.0);
    }
    let settings = EstimatorSettings::AdhesionSmoother(SmootherSettings::default());
    let snapshot = after(&mut pipeline(&settings), &moments);
    let truth = wet(moments[moments.len() - 26].speed_mps);
    assert!((snapshot.value(Parameter::Adhesion).unwrap() / truth - 1.0).abs() < 0.05);
}

#[test]
fn a_faster_controller_gives_the_same_estimate() {
    let settings = EstimatorSettings::AdhesionSmoother(SmootherSettings::default());
    let fast = Run { step_s: 0.02, ..WET };
    let moments = fast.simulate(8);
    let snapshot = after(&mut pipeline(&settings), &moments);
    let truth = wet(moments[moments.len() - 250].speed_mps);
    let value = snapshot.value(Parameter::Adhesion).unwrap();
    assert!((value / truth - 1.0).abs() < 0.05, "{value} instead of {truth}");
    assert!(snapshot.updates * 9 < snapshot.samples_used, "ten samples make one observation");
}

#[test]
fn the_papers_measurement_of_the_position_alone_serves_too() {
    let braking = BrakingSettings { uses_speed: false, ..Default::default() };
    let settings = SmootherSettings { braking, ..Default::default() };
    let moments = WET.simulate(9);
    let snapshot = after(&mut pipeline(&EstimatorSettings::AdhesionSmoother(settings)), &moments);
    let truth = wet(moments[moments.len() - 26].speed_mps);
    assert!((snapshot.value(Parameter::Adhesion).unwrap() / truth - 1.0).abs() < 0.06);
}
