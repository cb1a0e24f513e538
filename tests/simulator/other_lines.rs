//! Lines that are not those of the runs: read from the wrong end, with or without the other sign, or another line
//! altogether. The right line, and one that is shifted by an effect, raise nothing.

use std::path::Path;

use dynocar::dataset;
use dynocar_analysis::explain::answer::Verdict;
use dynocar_analysis::explain::explain;
use dynocar_analysis::explain::report::effect::to_do;
use dynocar_core::plausibility::Severity;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::write_dataset;
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, TrainType, simulate};
use toml::Value;

/// Seeds of a train and its line, each with the seed of another line.
const SEEDS: [(u64, u64); 3] = [(71_001, 71_011), (71_002, 71_012), (71_003, 71_013)];

fn write(seed: u64, effects: EffectRequest, folder: &Path) {
    let settings = SimulatorSettings {
        train_type: Some(TrainType::Freight),
        runs: 3,
        holdout_runs: 1,
        ..SimulatorSettings::new(seed, effects)
    };
    write_dataset(&simulate(&settings), folder).unwrap();
}

fn track(folder: &Path) -> toml::Table {
    std::fs::read_to_string(folder.join("track.toml")).unwrap().parse().unwrap()
}

/// Reads the gradients of a line from its other end, with climbs kept as climbs or turned into falls.
fn mirror(track: &mut toml::Table, sign: f64) {
    let line_m = track["track"]["length_m"].as_float().unwrap();
    let gradient = track["track"]["gradient"].as_array_mut().unwrap();
    let number = |entry: &Value, at: usize| entry[at].as_float().unwrap();
    let starts_m: Vec<f64> = gradient.iter().map(|entry| number(entry, 0)).collect();
    let ends_m = starts_m[1..].iter().copied().chain([line_m]);
    let mirrored = gradient.iter().zip(ends_m);
    let entry = |(entry, end_m): (&Value, f64)| {
        Value::from(vec![(line_m - end_m).max(0.0), -sign * number(entry, 1)])
    };
    let mut mirrored: Vec<Value> = mirrored.map(entry).collect();
    mirrored.reverse();
    *gradient = mirrored;
}

/// Returns the diagnostics of the line and how much they matter.
fn said(folder: &Path) -> Vec<(&'static str, Severity)> {
    let dataset = dataset::load(folder).unwrap();
    let found = dataset.diagnostics().into_iter().filter(|it| it.severity > Severity::Info);
    found.map(|it| (it.code, it.severity)).collect()
}

#[test]
fn a_line_read_from_its_other_end_cannot_be_true() {
    for (seed, _) in SEEDS {
        for sign in [1.0, -1.0] {
            let folder = tempfile::tempdir().unwrap();
            write(seed, EffectRequest::none(), folder.path());
            assert_eq!(said(folder.path()), [], "{seed}: the right line");
            let mut line = track(folder.path());
            mirror(&mut line, sign);
            std::fs::write(folder.path().join("track.toml"), line.to_string()).unwrap();
            let expected = [("mirrored_line", Severity::Fundamental)];
            assert_eq!(said(folder.path()), expected, "{seed}, sign {sign}");
        }
    }
}

#[test]
fn another_line_is_doubted_and_nothing_is_to_be_done_for_effects_found_on_it() {
    for (seed, other) in SEEDS {
        let [folder, elsewhere] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        write(seed, EffectRequest::none(), folder.path());
        write(other, EffectRequest::none(), elsewhere.path());
        let (mut own, other) = (track(folder.path()), track(elsewhere.path()));
        own["track"]["gradient"] = other["track"]["gradient"].clone();
        std::fs::write(folder.path().join("track.toml"), own.to_string()).unwrap();
        assert_eq!(said(folder.path()), [("other_line", Severity::Warning)], "{seed}");
        let dataset = dataset::load(folder.path()).unwrap();
        let answer = explain(&dataset, &|_, _| ()).unwrap().answer;
        assert_eq!(answer.verdict, Verdict::Unknown, "{seed}: {}", answer.statement);
        for effect in &answer.effects {
            assert!(effect.contradiction.is_some(), "{seed}: {}", answer.statement);
            assert!(to_do(effect).unwrap().starts_with("find out what is wrong"), "{seed}");
        }
    }
}

#[test]
fn a_shifted_line_is_an_effect() {
    for (seed, _) in SEEDS {
        let folder = tempfile::tempdir().unwrap();
        write(seed, EffectRequest::Kinds(vec![EffectKind::GradientShift]), folder.path());
        assert_eq!(said(folder.path()), [], "{seed}");
    }
}
