//! The same samples give the same bits: twice, at any rate, next to any other pipelines, and as in the golden file.

use std::path::Path;
use std::time::Duration;

use dynocar::config::is_slow;
use dynocar::dataset;
use dynocar::replay::{Rate, Replayer};
use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::identify::{default_estimators, identify, published_samples};
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainId};
use dynocar_tests::golden::{self, Golden, TOLERANCE, without_stamps};
use dynocar_tests::process::DaemonSite;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const TRAIN: TrainId = TrainId(1);

#[test]
fn recorded_runs_give_the_bits_of_the_golden_file_and_give_them_twice() {
    let first = golden::compute();
    let second = golden::compute();
    assert_eq!(first, second, "run twice in one process");
    let text = std::fs::read_to_string(golden::path()).expect("the golden file");
    let kept = Golden::from_text(&text).expect("a golden file of this form");
    let kinds = |it: &Golden| it.lines.iter().map(|line| line.kind.clone()).collect::<Vec<_>>();
    assert_eq!(kinds(&kept), kinds(&first), "the kinds of estimators");
    if kept.fingerprint == first.fingerprint {
        for (kept, found) in kept.lines.iter().zip(&first.lines) {
            assert_eq!(
                kept, found,
                "if the change is meant, see the head of tests/golden/demo.txt"
            );
        }
        return;
    }
    println!("another C library than the golden file's: values are compared, not bits");
    for (kept, found) in kept.lines.iter().zip(&first.lines) {
        assert_eq!(kept.counts, found.counts, "{}", kept.kind);
        for (kept_value, value) in kept.values.iter().zip(&found.values) {
            let distance = (kept_value - value).abs();
            let is_close = distance <= TOLERANCE * kept_value.abs().max(1e-9);
            assert!(is_close, "{}: {value}, kept {kept_value}", kept.kind);
        }
    }
}

#[test]
fn the_golden_files_form_leads_back_to_the_same_bits() {
    let golden = Golden {
        fingerprint: 7,
        lines: vec![golden::GoldenLine {
            kind: "rls".into(),
            counts: [1, 2, 3, 4],
            hash: u64::MAX,
            values: vec![1.0 / 3.0, -1e-300, 0.0],
        }],
    };
    assert_eq!(Golden::from_text(&golden.to_text()), Some(golden));
}

/// The snapshot of `v_mils` after a replay to a daemon with these pipelines.
fn online(dataset: &Dataset, rate: Rate, kinds: &[PipelineKind]) -> ParameterSnapshot {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo");
    let site = DaemonSite::new();
    for file in ["train.toml", "track.toml"] {
        site.write(file, &std::fs::read_to_string(folder.join(file)).expect("a demo file"));
    }
    let threads: String = [("fast", false), ("slow", true)]
        .iter()
        .filter(|(_, slow)| kinds.iter().any(|&kind| is_slow(kind) == *slow))
        .map(|(name, _)| format!("[[threads]]\nname = \"{name}\"\n"))
        .collect();
    let pipelines: String = kinds
        .iter()
        .map(|&kind| {
            let thread = if is_slow(kind) { "slow" } else { "fast" };
            format!("[[pipelines]]\nkind = \"{kind}\"\nthread = \"{thread}\"\n")
        })
        .collect();
    let text = format!(
        "[[trains]]\nid = 1\nfile = \"train.toml\"\ntrack = \"track.toml\"\n\
         {threads}{pipelines}"
    );
    let config = site.write("daemon.toml", &text);
    let daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().expect("UTF-8")]);
    daemon.await_error("serving");
    let mut replayer = Replayer::open(&site.host(), TRAIN, rate).expect("a replayer");
    assert!(replayer.await_daemon(Duration::from_secs(10)), "{}", daemon.errors());
    dataset.runs.iter().for_each(|run| replayer.play(&run.samples, |_| {}));
    let number = PipelineKind::VMils as u32;
    let snapshots = replayer.finish().snapshots;
    *snapshots.iter().find(|it| it.pipeline_kind == number).expect("v_mils")
}

#[test]
fn rate_and_other_pipelines_change_no_bit() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo");
    let mut dataset = dataset::load(&folder).expect("the demo's runs");
    dataset.runs.truncate(2);
    dataset.runs.iter_mut().for_each(|run| run.samples.truncate(800));
    let samples = published_samples(&dataset, TRAIN);
    let estimators = default_estimators();
    let v_mils = estimators.iter().find(|it| it.kind() == PipelineKind::VMils).expect("v_mils");
    let offline =
        without_stamps(identify(&dataset, &samples, v_mils).expect("default settings").snapshot());
    let all: Vec<PipelineKind> = estimators.iter().map(|it| it.kind()).collect();
    let few = [PipelineKind::MassKalman, PipelineKind::VMils];
    let cases: [(Rate, &[PipelineKind]); 3] =
        [(Rate::Times(150.0), &few[1..]), (Rate::Times(400.0), &few), (Rate::Max, &all)];
    for (rate, kinds) in cases {
        // On a machine so busy that samples are lost, the samples were not the same: once more.
        let complete = (0..5).find_map(|_| {
            let snapshot = online(&dataset, rate, kinds);
            let taken = snapshot.samples_used + snapshot.samples_rejected;
            (taken == samples.len() as u64).then(|| without_stamps(&snapshot))
        });
        assert_eq!(complete.expect("a replay without loss"), offline, "{rate:?}, {kinds:?}");
    }
}
