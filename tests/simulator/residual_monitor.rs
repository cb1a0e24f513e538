//! The residual monitor on simulated driving: it is silent while no undeclared effect acts, and names the right one
//! otherwise.

use std::sync::Arc;

use dynocar_core::pipeline::Pipeline;
use dynocar_core::pipeline::monitor::{MonitorSettings, ResidualMonitor};
use dynocar_model::train::TrainModel;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{ParameterSnapshot, SampleField, TrainSample};
use dynocar_tests::simulator::sensors::SIMULATED_TRAIN;
use dynocar_tests::simulator::{
    Defects, EffectRequest, Law, SimulatedDataset, SimulatorSettings, TrainType, TrueDeviations,
    TrueEffect, Unlisted, simulate,
};

fn dataset(seed: u64, train_type: Option<TrainType>, effects: EffectRequest) -> SimulatedDataset {
    let mut settings = SimulatorSettings::new(seed, effects);
    settings.train_type = train_type;
    settings.runs = 6;
    simulate(&settings)
}

/// Feeds all runs; calls `see` with the run, the time in s within it, and the snapshot.
fn watch(data: &SimulatedDataset, see: impl FnMut(usize, f64, &ParameterSnapshot)) {
    watch_with(MonitorSettings::default(), data, see);
}

/// The same with other settings.
fn watch_with(
    settings: MonitorSettings,
    data: &SimulatedDataset,
    mut see: impl FnMut(usize, f64, &ParameterSnapshot),
) {
    let train = Arc::new(data.declared_train().clone());
    let monitor = ResidualMonitor::new(settings, &train).expect("settings within their ranges");
    let monitor = Box::new(monitor);
    let track = Some(Arc::new(data.track().clone()));
    let mut pipeline = Pipeline::new(SIMULATED_TRAIN, 0, train, track, monitor);
    let mut sequence = 0;
    for run in &data.runs {
        let start_ns = run.samples[0].time_ns;
        for sample in &run.samples {
            sequence += 1;
            let snapshot = pipeline.process(&TrainSample { sequence, ..*sample });
            see(run.plan.number, (sample.time_ns - start_ns) as f64 * 1e-9, snapshot);
        }
    }
}

fn suspect(snapshot: &ParameterSnapshot) -> EffectKind {
    EffectKind::from_number(snapshot.suspected_effect).expect("a known number")
}

#[test]
fn nothing_undeclared_raises_no_alarm_on_any_type_of_train() {
    for (seed, train_type) in (100..).zip(TrainType::ALL) {
        let data = dataset(seed, Some(train_type), EffectRequest::none());
        let mut blocks = 0;
        watch(&data, |run, time_s, snapshot| {
            let found = suspect(snapshot);
            let train = train_type.name();
            assert_eq!(found, EffectKind::None, "{train}, seed {seed}, run {run}, {time_s} s");
            blocks = snapshot.updates;
        });
        assert!(blocks > 200, "{}: {blocks} blocks", train_type.name());
    }
}

/// Weights, map, curve constant, winds, forces, their lateness and wheels, all a little wrong.
fn rough(seed: u64, effects: EffectRequest) -> SimulatorSettings {
    SimulatorSettings { deviations: TrueDeviations::ROUGH, ..SimulatorSettings::new(seed, effects) }
}

#[test]
fn ordinary_days_with_everything_a_little_wrong_raise_hardly_an_alarm_on_any_type_of_train() {
    // Two of these ten days have one, both of freight trains; of 560 days of any train seven had.
    let mut alarms = Vec::new();
    for (seed, train_type) in (7001..).zip(TrainType::ALL.into_iter().chain(TrainType::ALL)) {
        let settings = SimulatorSettings {
            train_type: Some(train_type),
            ..rough(seed, EffectRequest::none())
        };
        let mut found = EffectKind::None;
        watch(&simulate(&settings), |_, _, snapshot| {
            if found == EffectKind::None {
                found = suspect(snapshot);
            }
        });
        if found != EffectKind::None {
            alarms.push((train_type, seed, found));
        }
    }
    assert!(alarms.len() <= 2, "{alarms:?}");
}

#[test]
fn a_train_that_declares_its_tare_and_its_full_load_is_told_of_no_changed_mass() {
    for (seed, train_type) in (120..).zip(TrainType::ALL) {
        let mut data = dataset(seed, Some(train_type), EffectRequest::none());
        // Every load that it drives with lies between the tare and 1.4 times that.
        let tare_kg = data.declared_train().mass_kg / 1.2;
        data.train.declared.mass_kg = tare_kg;
        for sample in data.runs.iter_mut().flat_map(|run| &mut run.samples) {
            sample.valid &= !SampleField::Mass.bit();
        }
        let named = [None, Some(1.4)].map(|full| {
            data.train.declared.full_mass_kg = full.map(|full: f64| full * tare_kg);
            let mut named = 0;
            watch(&data, |_, _, snapshot| {
                named += usize::from(suspect(snapshot) == EffectKind::MassChange);
            });
            named
        });
        assert!(named[0] > 100, "{}: {named:?}", train_type.name());
        assert_eq!(named[1], 0, "{}", train_type.name());
    }
}

#[test]
fn a_strong_effect_is_named_on_an_ordinary_day() {
    for (seed, kind) in [
        (7001, EffectKind::TunnelDrag),
        (7002, EffectKind::ActuatorDelay),
        (7003, EffectKind::LowAdhesion),
    ] {
        let mut named = 0;
        watch(&simulate(&rough(seed, EffectRequest::Kinds(vec![kind]))), |_, _, snapshot| {
            named += usize::from(suspect(snapshot) == kind);
        });
        assert!(named > 100, "{kind}, seed {seed}: for {named} samples");
    }
}

#[test]
fn a_row_in_fifty_that_is_wildly_wrong_raises_no_alarm() {
    for seed in 110..113 {
        let mut settings = SimulatorSettings::new(seed, EffectRequest::none());
        settings.defects = Defects { outliers: 0.02, ..Defects::ALL };
        watch(&simulate(&settings), |run, time_s, snapshot| {
            assert_eq!(suspect(snapshot), EffectKind::None, "seed {seed}, run {run}, {time_s} s");
        });
    }
}

#[test]
fn forces_that_are_calibrated_anew_for_a_run_are_no_brake_that_drags() {
    for seed in [51_118, 51_276] {
        let settings = SimulatorSettings::new(seed, EffectRequest::none());
        watch(&simulate(&settings), |run, time_s, snapshot| {
            assert_eq!(suspect(snapshot), EffectKind::None, "seed {seed}, run {run}, {time_s} s");
        });
    }
}

#[test]
fn what_no_force_or_a_scale_of_forces_shows_is_named_too() {
    for (seed, kind) in [
        (310, EffectKind::WheelDiameter),
        (311, EffectKind::ActuatorDelay),
        (312, EffectKind::TractionGain),
        (313, EffectKind::LowAdhesion),
        (314, EffectKind::MassChange),
    ] {
        let data = dataset(seed, None, EffectRequest::Kinds(vec![kind]));
        let mut named = 0;
        watch(&data, |_, _, snapshot| named += usize::from(suspect(snapshot) == kind));
        assert!(named > 100, "{kind}, seed {seed}: for {named} samples");
    }
}

#[test]
fn a_force_by_a_law_of_the_speed_that_no_term_follows_is_said_to_be_unknown() {
    for (seed, law) in [
        (330, Law::Slow { below_mps: 15.0, least_mps: 3.0 }),
        (331, Law::Band { centre_mps: 14.0, width_mps: 3.0 }),
    ] {
        let unlisted = TrueEffect::Unlisted(Unlisted { law, n_per_kn: 1.0 });
        let data = dataset(seed, None, EffectRequest::Exactly(vec![unlisted]));
        let (mut unknown, mut others) = (0, 0);
        watch(&data, |_, _, snapshot| match suspect(snapshot) {
            EffectKind::None => {}
            EffectKind::Unknown => unknown += 1,
            _ if snapshot.alternatives().any(|it| it == EffectKind::Unknown) => unknown += 1,
            _ => others += 1,
        });
        assert!(unknown > 1000 && unknown > 20 * others, "seed {seed}: {unknown}, others {others}");
    }
}

#[test]
fn what_cannot_be_distinguished_is_reported_as_alternatives() {
    // On a level, straight line another rotating mass acts like another mass.
    let kinds = EffectRequest::Kinds(vec![EffectKind::RotatingMass]);
    let mut settings = SimulatorSettings::new(320, kinds);
    settings.is_level_and_straight = true;
    // A few % of it lie within the uncertainty of a load, so the monitor never suspects one of the two kinds alone.
    watch(&simulate(&settings), |run, time_s, snapshot| {
        let is_alone =
            suspect(snapshot) != EffectKind::None && snapshot.alternatives().count() == 0;
        assert!(!is_alone, "run {run}, {time_s} s: {} alone", suspect(snapshot));
    });
}

/// The first of some datasets whose brake drags with half of Davis a or more: a smaller force lies within the effects
/// of winds and loads on ordinary days, and is named late or not at all.
fn metro_whose_brake_drags() -> SimulatedDataset {
    let kinds = || EffectRequest::Kinds(vec![EffectKind::DraggingBrake]);
    let is_strong = |data: &SimulatedDataset| {
        let weight_kn = TrainModel::weight_kn(data.train.declared.mass_kg);
        let share = |force_n: f64| force_n / (data.train.resistance.a * weight_kn);
        matches!(data.effects[0], TrueEffect::DraggingBrake { force_n, .. } if share(force_n) >= 0.5)
    };
    let mut all = (200..260).map(|seed| dataset(seed, Some(TrainType::Metro), kinds()));
    all.find(is_strong).expect("a strong one of sixty")
}

#[test]
fn a_suspicion_ends_with_its_cause() {
    let data = metro_whose_brake_drags();
    let TrueEffect::DraggingBrake { windows, .. } = &data.effects[0] else {
        panic!("expected a dragging brake, got {:?}", data.effects);
    };
    let drags_in = |run: usize| windows.iter().any(|window| window.run == run);
    assert!((0..data.runs.len()).any(drags_in) && !(0..data.runs.len()).all(drags_in));
    let mut age_s = 0;
    watch(&data, |run, time_s, snapshot| {
        if !drags_in(run) {
            assert_eq!(suspect(snapshot), EffectKind::None, "run {run}, {time_s} s");
            assert_eq!(snapshot.suspicion_age_s, 0);
        }
        age_s = age_s.max(snapshot.suspicion_age_s);
    });
    assert!(age_s > 60, "it stood for {age_s} s");
}

#[test]
fn a_dragging_brake_is_suspected_soon_after_its_onset_and_not_before() {
    let data = metro_whose_brake_drags();
    let TrueEffect::DraggingBrake { windows, .. } = &data.effects[0] else {
        panic!("expected a dragging brake, got {:?}", data.effects);
    };
    let window = windows[0];
    let mut noticed_s = None;
    watch(&data, |run, time_s, snapshot| {
        if run == window.run && suspect(snapshot) == EffectKind::DraggingBrake {
            noticed_s.get_or_insert(time_s);
        }
    });
    let noticed_s = noticed_s.expect("the brake is noticed");
    let delay_s = noticed_s - window.start_s;
    assert!((0.0..240.0).contains(&delay_s), "noticed {delay_s} s after the onset");
}

#[test]
fn the_suspect_is_the_effect_that_is_there() {
    for (seed, kind) in
        [(300, EffectKind::TunnelDrag), (301, EffectKind::CurveResistance), (302, EffectKind::Wind)]
    {
        let data = dataset(seed, None, EffectRequest::Kinds(vec![kind]));
        let mut last = EffectKind::None;
        watch(&data, |_, _, snapshot| last = suspect(snapshot));
        assert_eq!(last, kind, "seed {seed}");
    }
}
