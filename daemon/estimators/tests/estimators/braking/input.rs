use dynocar_core::pipeline::braking::settings::{BrakingSettings, LawSettings, SmootherSettings};
use dynocar_estimators::EstimatorSettings;
use dynocar_estimators::xie::EmSettings;
use dynocar_model::train::BrakeGear;
use dynocar_shared::sample::FLAG_WHEEL_SLIDE;
use dynocar_shared::{
    Manoeuvre, Parameter, PipelineKind, Reason, RejectionReason, SampleField, Status,
};

use super::simulation::{
    FULL_BRAKING, KINDS, Run, after, assert_finite, pipeline, pipeline_for, train, wet,
};

const WET: Run = Run { adhesion: |_, speed_mps| wet(speed_mps), ..FULL_BRAKING };

fn default_of(kind: PipelineKind) -> EstimatorSettings {
    EstimatorSettings::default_of(kind).expect("a braking pipeline")
}

fn smoother() -> EstimatorSettings {
    default_of(PipelineKind::AdhesionSmoother)
}

#[test]
fn what_is_missing_is_named_and_nothing_is_estimated() {
    let cases = [
        (SampleField::BrakeCylinderPressure, Reason::MissingQuantity),
        (SampleField::Position, Reason::MissingQuantity),
        (SampleField::Gradient, Reason::GradientUnknown),
    ];
    for kind in KINDS {
        for (field, reason) in cases {
            let mut moments = WET.simulate(1);
            for moment in &mut moments {
                moment.sample.valid &= !field.bit();
            }
            let snapshot = after(&mut pipeline(&default_of(kind)), &moments);
            assert_eq!(snapshot.status(), Status::Unestimated, "{kind} without {field:?}");
            assert_eq!(snapshot.reason(), Some(reason), "{kind} without {field:?}");
            assert_eq!(snapshot.rejected(RejectionReason::Missing), moments.len() as u32);
            assert_eq!(snapshot.missing_manoeuvres, Manoeuvre::Brake.bit());
        }
    }
}

#[test]
fn a_train_without_declared_gear_has_no_friction() {
    for kind in [PipelineKind::BrakeEm, PipelineKind::BrakeEkf, PipelineKind::BrakeSmoother] {
        let mut train = train();
        train.brake_gear = BrakeGear { pads: None, ..train.brake_gear };
        let snapshot = after(&mut pipeline_for(&default_of(kind), train), &WET.simulate(1));
        assert_eq!(snapshot.status(), Status::Unestimated);
        assert_eq!(snapshot.reason(), Some(Reason::MissingQuantity));
    }
}

#[test]
fn a_train_that_does_not_brake_shows_nothing() {
    for kind in KINDS {
        let run = Run { pressure_pa: |_| 0.0, ..WET };
        let snapshot = after(&mut pipeline(&default_of(kind)), &run.simulate(2));
        assert_eq!(snapshot.status(), Status::Unestimated, "{kind}");
        assert_eq!((snapshot.updates, snapshot.samples_rejected), (0, 0), "{kind}");
        assert_eq!(snapshot.missing_manoeuvres, Manoeuvre::Brake.bit());
    }
}

#[test]
fn an_estimate_is_held_after_the_braking_and_grows_stale() {
    let run = Run {
        pressure_pa: |time_s| if time_s < 20.0 { 410_000.0 } else { 0.0 },
        seconds: 60.0,
        ..WET
    };
    let braking = BrakingSettings { stale_after_s: 30.0, ..Default::default() };
    let settings = SmootherSettings { braking, ..Default::default() };
    let mut pipeline = pipeline(&EstimatorSettings::AdhesionSmoother(settings));
    for moment in run.simulate(3) {
        let snapshot = *pipeline.process(&moment.sample);
        match moment.time_s {
            15.0..49.0 => assert_eq!(snapshot.status(), Status::Estimated, "{}", moment.time_s),
            50.5..60.0 => {
                assert_eq!(snapshot.status(), Status::Unestimated);
                assert_eq!(snapshot.reason(), Some(Reason::EstimateStale));
                assert!(snapshot.value(Parameter::Adhesion).is_some());
            }
            _ => {}
        }
    }
}

#[test]
fn an_estimate_that_is_too_uncertain_is_shown_but_does_not_count() {
    // No estimate is ever precise enough.
    let braking = BrakingSettings { relative_std_max: 1e-6, ..Default::default() };
    let settings = SmootherSettings { braking, ..Default::default() };
    let mut pipeline = pipeline(&EstimatorSettings::AdhesionSmoother(settings));
    let mut values = Vec::new();
    for moment in WET.simulate(11) {
        let snapshot = pipeline.process(&moment.sample);
        assert_eq!(snapshot.status(), Status::Unestimated);
        assert_eq!(snapshot.reason(), Some(Reason::TooFewSamples));
        values.push(snapshot.values[0]);
    }
    assert_ne!(values[100], values[120], "the newest is shown");
}

#[test]
fn a_gap_ends_the_braking_and_the_next_segment_starts_anew() {
    for kind in KINDS {
        let mut moments = WET.simulate(4);
        for (index, moment) in moments.iter_mut().enumerate() {
            if index >= 60 {
                moment.sample.time_ns += 20_000_000_000;
                // A balise corrected the position meanwhile.
                moment.sample.position_m += 40.0;
            }
        }
        let mut pipeline = pipeline(&default_of(kind));
        for (index, moment) in moments.iter().enumerate() {
            let snapshot = pipeline.process(&moment.sample);
            assert_finite(snapshot);
            if (60..64).contains(&index) && snapshot.parameter_count > 0 {
                assert_eq!(snapshot.reason(), Some(Reason::EstimateStale), "{kind} at {index}");
            }
        }
        assert_ne!(pipeline.snapshot().status(), Status::Unestimated, "{kind}");
        assert_eq!(pipeline.snapshot().rejected(RejectionReason::Outlier), 0, "{kind}");
    }
}

#[test]
fn bad_values_are_refused_and_leave_no_trace() {
    for kind in KINDS {
        let clean = WET.simulate(5);
        let mut spoilt = WET.simulate(5);
        for (index, moment) in spoilt.iter_mut().enumerate() {
            match index % 40 {
                7 => moment.sample.position_m = f64::NAN,
                19 => moment.sample.speed_mps = f64::INFINITY,
                31 => moment.sample.brake_cylinder_pressure_pa = 1e9,
                _ => {}
            }
        }
        let expected = after(&mut pipeline(&default_of(kind)), &clean);
        let found = after(&mut pipeline(&default_of(kind)), &spoilt);
        assert!(found.samples_rejected > 8, "{kind}");
        assert_eq!(found.parameters[0], expected.parameters[0], "{kind}");
        let std = expected.covariance_at(0, 0).sqrt();
        assert!((found.values[0] - expected.values[0]).abs() < 2.0 * std, "{kind}");
    }
}

#[test]
fn quantities_that_drop_out_now_and_then_do_not_end_the_braking() {
    for kind in KINDS {
        let mut moments = WET.simulate(10);
        for (index, moment) in moments.iter_mut().enumerate() {
            let field = match index % 12 {
                5 => SampleField::Position,
                9 | 10 => SampleField::BrakeCylinderPressure,
                _ => continue,
            };
            moment.sample.valid &= !field.bit();
        }
        let expected = after(&mut pipeline(&default_of(kind)), &WET.simulate(10));
        let found = after(&mut pipeline(&default_of(kind)), &moments);
        assert!(found.rejected(RejectionReason::Missing) > 30, "{kind}");
        assert_eq!(found.status(), expected.status(), "{kind}");
        assert_eq!(found.generation, 0, "{kind}");
        let std = expected.covariance_at(0, 0).sqrt();
        assert!((found.values[0] - expected.values[0]).abs() < 2.5 * std, "{kind}");
    }
}

#[test]
fn a_position_spike_is_refused_as_an_outlier() {
    let mut moments = WET.simulate(6);
    moments[120].sample.position_m += 25.0;
    let snapshot = after(&mut pipeline(&smoother()), &moments);
    assert_eq!(snapshot.rejected(RejectionReason::Outlier), 1);
    assert_eq!(snapshot.status(), Status::Estimated);
    assert_eq!(snapshot.generation, 0, "one spike restarts nothing");
}

#[test]
fn a_corrected_position_restarts_the_estimate_and_is_counted() {
    let mut moments = WET.simulate(7);
    for moment in &mut moments[100..] {
        moment.sample.position_m += 25.0;
    }
    let snapshot = after(&mut pipeline(&smoother()), &moments);
    assert_eq!(snapshot.generation, 1);
    assert_eq!(snapshot.rejected(RejectionReason::Outlier), 4, "the fifth one is believed");
    assert_eq!(snapshot.status(), Status::Estimated);
}

#[test]
fn sliding_wheels_show_nothing_unless_the_position_is_independent_of_them() {
    let mut moments = WET.simulate(8);
    for moment in &mut moments[50..] {
        moment.sample.flags |= FLAG_WHEEL_SLIDE;
        moment.sample.speed_mps *= 0.99;
    }
    let sliding = (moments.len() - 50) as u32;
    let refused = after(&mut pipeline(&smoother()), &moments);
    assert_eq!(refused.rejected(RejectionReason::WheelSlide), sliding);
    let braking = BrakingSettings { position_is_wheel_independent: true, ..Default::default() };
    let settings = SmootherSettings { braking, ..Default::default() };
    let used = after(&mut pipeline(&EstimatorSettings::AdhesionSmoother(settings)), &moments);
    assert_eq!(used.rejected(RejectionReason::WheelSlide), 0);
    let truth = wet(moments[moments.len() - 26].speed_mps);
    let value = used.value(Parameter::Adhesion).unwrap();
    assert!((value / truth - 1.0).abs() < 0.06, "{value} instead of {truth}");
}

#[test]
fn the_same_samples_give_the_same_bits() {
    for kind in KINDS {
        let run = || after(&mut pipeline(&default_of(kind)), &WET.simulate(9));
        let (one, other) = (run(), run());
        assert_eq!(one.values.map(f64::to_bits), other.values.map(f64::to_bits), "{kind}");
    }
}

#[test]
fn a_setting_out_of_range_is_refused_by_name() {
    let train = std::sync::Arc::new(train());
    let key = |settings: EstimatorSettings| settings.build(&train).err().map(|error| error.key);
    let em = EmSettings::default();
    let refused = [
        (EstimatorSettings::AdhesionEm(EmSettings { particles: 1, ..em }), "particles"),
        (EstimatorSettings::AdhesionEm(EmSettings { slide: 40, ..em }), "slide"),
        (EstimatorSettings::BrakeEm(EmSettings { initial: Some(-1.0), ..em }), "initial"),
        (
            EstimatorSettings::AdhesionLaw(LawSettings {
                scale_std: f64::NAN,
                ..Default::default()
            }),
            "scale_std",
        ),
        (
            EstimatorSettings::BrakeSmoother(SmootherSettings {
                lag_s: -1.0,
                ..Default::default()
            }),
            "lag_s",
        ),
    ];
    for (settings, expected) in refused {
        assert_eq!(key(settings), Some(expected));
    }
}

#[test]
fn settings_are_read_from_a_configuration() {
    let text = r#"
        kind = "brake_smoother"
        lag_s = 2.0
        reports = "ratio"
        walk = { kind = "scale", std_after_1_s = 0.01 }
        braking = { position_std_m = 0.5, uses_speed = false }
    "#;
    let settings: EstimatorSettings = toml::from_str(text).unwrap();
    assert_eq!(settings.kind(), PipelineKind::BrakeSmoother);
    let EstimatorSettings::BrakeSmoother(settings) = settings else { unreachable!() };
    assert_eq!((settings.lag_s, settings.braking.position_std_m), (2.0, 0.5));
    let misspelt = "kind = \"adhesion_em\"\nparticels = 20";
    assert!(toml::from_str::<EstimatorSettings>(misspelt).is_err());
}
