//! An explanation in a recording: every moment of it lies where the recording has that moment.

use std::collections::HashMap;

use dynocar_analysis::explain::answer::Verdict;
use dynocar_analysis::explain::report::timeline::{
    ActingEffect, ResidualWindow, RunTimeline, SpeedPoint, Timeline,
};
use dynocar_mcap::annotate::{AnnotateError, OtherRuns, annotate};
use dynocar_mcap::annotate::{Effect, PredictedSpeed, Residual};
use dynocar_mcap::error::ReadError;
use dynocar_mcap::reading::{Raw, RecordingItem, Visitor, read};
use dynocar_mcap::recording::Recording;
use dynocar_shared::TrainSample;
use prost::Message;

use crate::support::{samples, snapshots, write};

/// The messages of each topic: when they were logged, and their bytes.
#[derive(Default)]
struct Logged(HashMap<String, Vec<(u64, Vec<u8>)>>);

impl Visitor for Logged {
    type Error = ReadError;

    fn item(&mut self, _: RecordingItem<'_>) -> Result<(), ReadError> {
        Ok(())
    }

    fn raw(&mut self, raw: &Raw<'_>) -> Result<(), ReadError> {
        let of_topic = self.0.entry(raw.channel.topic.clone()).or_default();
        of_topic.push((raw.header.log_time, raw.data.to_vec()));
        Ok(())
    }
}

/// An effect in the second run, from its tenth to its thirtieth sample.
fn timeline(runs: &[&[TrainSample]]) -> Timeline {
    let time_s = |it: &TrainSample| it.time_ns as f64 * 1e-9;
    let speed = |it: &TrainSample| SpeedPoint {
        time_s: time_s(it),
        measured_mps: it.speed_mps,
        before_mps: it.speed_mps + 0.5,
        after_mps: it.speed_mps - 0.25,
    };
    let residual = |run: &[TrainSample]| ResidualWindow {
        from_s: time_s(&run[0]),
        to_s: time_s(&run[40]),
        before_n_per_kn: 1.5,
        after_n_per_kn: -0.125,
    };
    let effect = |run: &[TrainSample]| ActingEffect {
        kind: "tunnel_drag".into(),
        number: 1,
        text: "tunnel drag".into(),
        from_s: time_s(&run[10]),
        to_s: time_s(&run[30]),
        positions_m: Some([run[10].position_m, run[30].position_m]),
        error_reduction: 0.5,
        p_value: 0.001,
    };
    let of_run = |(index, run): (usize, &&[TrainSample])| RunTimeline {
        file: format!("runs/{index}.csv"),
        number: index as u32 + 1,
        speeds: run.iter().map(speed).collect(),
        residuals: vec![residual(run)],
        effects: if index == 1 { vec![effect(run)] } else { Vec::new() },
    };
    Timeline {
        verdict: Verdict::Effect,
        statement: "a tunnel".into(),
        rmse_before_mps: Some(0.5),
        rmse_after_mps: None,
        runs: runs.iter().enumerate().map(of_run).collect(),
    }
}

#[test]
fn an_explanation_lies_next_to_the_data_at_the_moments_that_it_speaks_of() {
    let folder = tempfile::tempdir().unwrap();
    let (plain, annotated) = (folder.path().join("run.mcap"), folder.path().join("annotated.mcap"));
    let samples = samples();
    write(&plain, &samples, &snapshots(&samples, 100));
    let runs: Vec<&[TrainSample]> = samples.chunk_by(|one, next| one.run == next.run).collect();
    assert_eq!(runs.len(), 2);

    let added = annotate(&plain, None, &timeline(&runs), &annotated).unwrap();
    assert_eq!((added.effects, added.messages), (1, 1 + 1 + 2 + samples.len()));

    let (before, after) = (Recording::load(&plain).unwrap(), Recording::load(&annotated).unwrap());
    assert_eq!(before.samples, after.samples);
    assert_eq!(before.snapshots, after.snapshots);
    assert_eq!(before.attachments, after.attachments);

    let mut logged = Logged::default();
    read(&annotated, &mut logged).unwrap();
    let of = |topic: &str| &logged.0[topic];
    let sample_at: Vec<u64> = of("/train/1/samples").iter().map(|it| it.0).collect();
    let speeds = of("/train/1/explain/speed");
    assert_eq!(sample_at, speeds.iter().map(|it| it.0).collect::<Vec<_>>());
    for (sample, (_, bytes)) in samples.iter().zip(speeds) {
        let speed = PredictedSpeed::decode(&bytes[..]).unwrap();
        assert_eq!(speed.measured_speed_mps, sample.speed_mps);
        assert!((speed.error_before_mps - 0.5).abs() < 1e-12);
        assert!((speed.error_after_mps + 0.25).abs() < 1e-12);
    }
    let [(at_ns, bytes)] = &of("/explain/effects")[..] else { panic!("one effect") };
    let effect = Effect::decode(&bytes[..]).unwrap();
    let first = runs[0].len();
    assert_eq!((*at_ns, effect.end_ns), (sample_at[first + 10], sample_at[first + 30]));
    assert_eq!(effect.end_position_m, Some(runs[1][30].position_m));
    let residuals = of("/train/1/explain/residual");
    assert_eq!(residuals[1].0, sample_at[first] / 2 + sample_at[first + 40] / 2);
    assert_eq!(Residual::decode(&residuals[1].1[..]).unwrap().residual_before_n_per_kn, 1.5);
    assert_eq!(of("/explain/verdict")[0].0, sample_at[0]);
}

#[test]
fn an_explanation_of_other_runs_is_refused_and_nothing_is_left_behind() {
    let folder = tempfile::tempdir().unwrap();
    let (plain, annotated) = (folder.path().join("run.mcap"), folder.path().join("annotated.mcap"));
    let samples = samples();
    write(&plain, &samples, &[]);
    let runs: Vec<&[TrainSample]> = samples.chunk_by(|one, next| one.run == next.run).collect();
    let other = timeline(&[runs[0], runs[1], runs[1]]);
    let refused = annotate(&plain, None, &other, &annotated).unwrap_err();
    let AnnotateError::OtherRuns(refused) = refused else { panic!("{refused}") };
    assert_eq!(refused.problem, OtherRuns { trains: 1, runs: 2, explained: 3 }, "{refused}");
    assert!(!annotated.exists());
}
