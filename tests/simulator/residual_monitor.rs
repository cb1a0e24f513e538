//! The residual monitor on simulated driving: silent while nothing is undeclared, and right about
//! what is.

use std::sync::Arc;

use dynocar_core::pipeline::{EstimatorSettings, Pipeline};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainSample};
use dynocar_tests::simulator::sensors::SIMULATED_TRAIN;
use dynocar_tests::simulator::{
    Effect, EffectRequest, SimulatedDataset, SimulatorSettings, TrainType, simulate,
};

fn dataset(seed: u64, train_type: Option<TrainType>, effects: EffectRequest) -> SimulatedDataset {
    let mut settings = SimulatorSettings::new(seed, effects);
    settings.train_type = train_type;
    settings.runs = 6;
    simulate(&settings)
}

/// Feeds all runs; calls `see` with the run, the time in s within it, and the snapshot.
fn watch(data: &SimulatedDataset, mut see: impl FnMut(usize, f64, &ParameterSnapshot)) {
    let train = Arc::new(data.declared_train().clone());
    let settings = EstimatorSettings::default_of(PipelineKind::ResidualMonitor);
    let monitor = settings.expect("the kind can be built").build(&train).expect("default settings");
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

#[test]
fn a_dragging_brake_is_suspected_soon_after_its_onset_and_not_before() {
    let kinds = EffectRequest::Kinds(vec![EffectKind::DraggingBrake]);
    let data = dataset(200, Some(TrainType::Metro), kinds);
    let Effect::DraggingBrake { windows, .. } = &data.effects[0] else {
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
