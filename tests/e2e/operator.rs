//! Messages of a real daemon to an operator: in its log, and from `dynocar health`.

use std::time::Duration;

use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{PipelineKind, SampleField, TrainId, TrainSample};
use dynocar_tests::process::{DaemonSite, Process, await_true};
use dynocar_tests::simulator::dataset_writer::dataset_files;
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, simulate};
use dynocar_transport::monotonic_now_ns;
use rustix::process::Signal;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const TRAIN: TrainId = TrainId(1);
/// Seed of the simulated train with its brake.
const SEED: u64 = 315;

fn daemon(site: &DaemonSite, config: &str) -> Process {
    let config = site.write("daemon.toml", config);
    let daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().unwrap()]);
    daemon.await_error("serving");
    daemon
}

fn health(site: &DaemonSite) -> (Option<i32>, String) {
    let mut process = site.start(DYNOCAR, &["health", "--train", "1"]);
    (process.wait().code(), process.output())
}

#[test]
fn a_dragging_brake_is_named_with_its_force_its_place_and_what_to_do() {
    let site = DaemonSite::new();
    let kinds = EffectRequest::Kinds(vec![EffectKind::DraggingBrake]);
    let simulated = simulate(&SimulatorSettings::new(SEED, kinds));
    for (name, text) in dataset_files(&simulated) {
        if ["train.toml", "track.toml"].contains(&name.as_str()) {
            site.write(&name, &text);
        }
    }
    let mut daemon = daemon(
        &site,
        "[[trains]]\nid = 1\nfile = \"train.toml\"\ntrack = \"track.toml\"\n\
         [[pipelines]]\nkind = \"residual_monitor\"\nname = \"monitor\"\n",
    );
    let mut publisher = SamplePublisher::open(&site.host(), TRAIN).unwrap();
    let mut reader = SnapshotReader::open(&site.host(), TRAIN).unwrap();
    let mut is_named = || {
        reader.poll();
        let reading = reader.latest(PipelineKind::ResidualMonitor, monotonic_now_ns());
        let found = reading.map_or(0, |it| it.snapshot.suspected_effect);
        found == EffectKind::DraggingBrake as u32
    };
    let samples = simulated.runs.iter().flat_map(|run| &run.samples);
    let mut published = 0;
    for sample in samples {
        publisher.publish(&mut TrainSample { train_id: TRAIN.0, ..*sample }).unwrap();
        published += 1;
        if published % 100 == 0 {
            std::thread::sleep(Duration::from_millis(2));
            if is_named() {
                break;
            }
        }
    }
    await_true(&mut is_named, || format!("a suspicion after {published} samples"));
    daemon.await_error("suspect=\"dragging_brake\"");
    let log = daemon.errors();
    let line = log.lines().find(|it| it.contains("the model lacks a force")).unwrap_or_default();
    for words in [
        "WARN",
        "pipeline=\"monitor\"",
        "force=\"+",
        " kN\"",
        "near_km=\"",
        "dragging_brake for ",
        "evidence ",
        "to do: at the next stop check that every brake releases",
    ] {
        assert!(line.contains(words), "{words:?} in {line:?} of\n{log}");
    }
    let degraded = log.lines().find(|it| it.contains("reason=innovations_not_white"));
    let degraded = degraded.unwrap_or_else(|| panic!("the degradation:\n{log}"));
    assert!(degraded.contains("WARN") && degraded.contains("to do: record a run"), "{degraded}");

    let (code, words) = health(&site);
    assert_eq!(code, Some(3), "{words}");
    assert!(words.contains("suspected: dragging_brake for "), "{words}");
    let last = words.lines().last().unwrap_or_default();
    assert!(last.starts_with("  to do: at the next stop check"), "{words}");
    assert!(daemon.end(Signal::TERM).success());
}

#[test]
fn refused_samples_are_named_with_their_reasons_and_what_to_do() {
    let site = DaemonSite::new();
    let config = site.write_config(1, "", "[[pipelines]]\nkind = \"echo\"\n");
    let config = std::fs::read_to_string(config).unwrap();
    let mut daemon = daemon(&site, &config);
    let mut publisher = SamplePublisher::open(&site.host(), TRAIN).unwrap();
    for index in 0..20 {
        let speed_mps = if index % 2 == 0 { 20.0 } else { f64::NAN };
        let mut sample = TrainSample::empty(TRAIN).with(SampleField::Speed, speed_mps);
        sample.time_ns = monotonic_now_ns();
        publisher.publish(&mut sample).unwrap();
        std::thread::sleep(Duration::from_millis(1));
    }
    daemon.await_error("samples refused; to do: leave the bit out");
    let (_, words) = health(&site);
    assert!(words.contains("refused: not_finite 10"), "{words}");
    assert!(
        words.ends_with("  to do: nothing\n") || words.ends_with("  to do: nothing"),
        "{words}"
    );
    assert!(daemon.end(Signal::TERM).success());
    let log = daemon.errors();
    let named = log.lines().find(|it| it.contains("samples refused")).unwrap_or_default();
    assert!(named.contains("WARN") && named.contains("refused=\"not_finite "), "{log}");
    let end = log.lines().find(|it| it.contains("rejected=10")).unwrap_or_default();
    assert!(end.contains("refused=\"not_finite 10\""), "{log}");
}
