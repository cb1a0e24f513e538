//! A recording of two trains: every command over recorded runs uses the train that `--train` names.

use std::path::Path;

use dynocar_analysis::identify::published_samples;
use dynocar_mcap::topic::Message;
use dynocar_mcap::writing::{RecordingWriter, WallClock};
use dynocar_shared::{TrainId, TrainSample};
use dynocar_tests::process::DaemonSite;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");

/// Records the demo's train as train 1, and one of half its mass and forces as train 2.
fn record(site: &DaemonSite) -> String {
    let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo");
    let path = site.path().join("two.mcap");
    let file = std::fs::File::create_new(&path).expect("a new file");
    let mut writer = RecordingWriter::new(file, WallClock::of_another_host()).expect("a writer");
    let text = |name: &str| std::fs::read_to_string(demo.join(name)).expect("a file of the demo");
    let mut half: toml::Table = text("train.toml").parse().expect("TOML");
    let mass = half["train"].get_mut("mass_t").expect("a mass");
    *mass = toml::Value::Float(mass.as_float().expect("a number") / 2.0);
    let models = [text("train.toml"), half.to_string()];
    for (id, train) in (1..).zip(models) {
        for (name, text) in [("train", train), ("track", text("track.toml"))] {
            let name = format!("configuration-1/{name}-{id}.toml");
            writer.attach(&name, text.as_bytes(), 0).expect("attached");
        }
    }
    let dataset = dynocar::dataset::load(&demo).expect("the demo");
    for sample in published_samples(&dataset, TrainId(1)) {
        let published_ns = i64::from(sample.run) * 10_000_000_000_000 + sample.time_ns;
        let first = TrainSample { published_ns, mass_kg: 0.0, valid: sample.valid, ..sample };
        let second = TrainSample {
            train_id: 2,
            traction_force_n: sample.traction_force_n / 2.0,
            brake_force_n: sample.brake_force_n / 2.0,
            mass_kg: sample.mass_kg / 2.0,
            ..first
        };
        let first = TrainSample { mass_kg: sample.mass_kg, ..first };
        [first, second].iter().for_each(|it| writer.write(Message::Sample(it)).expect("written"));
    }
    writer.finish().expect("finished");
    path.display().to_string()
}

fn run(site: &DaemonSite, arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut process = site.start(DYNOCAR, arguments);
    let status = process.wait();
    (status.code(), process.output(), process.errors())
}

#[test]
fn every_command_takes_the_train_that_is_named() {
    let site = DaemonSite::new();
    let path = record(&site);
    let mut masses = Vec::new();
    for train in ["1", "2"] {
        let (code, said, errors) =
            run(&site, &["identify", &path, "--train", train, "--json", "-"]);
        assert_eq!(code, Some(0), "{errors}");
        let answer: serde_json::Value = serde_json::from_str(&said).expect("JSON");
        let kalman = &answer["estimators"][0];
        assert_eq!(kalman["status"], "estimated");
        masses.push(kalman["values"]["mass_t"].as_f64().expect("a mass"));
        let (code, said, errors) = run(&site, &["check", &path, "--train", train]);
        assert_eq!(code, Some(0), "{errors}");
        let mass = if train == "1" { "1799.2 t" } else { "899.6 t" };
        assert!(said.contains(mass), "{said}");
    }
    assert!((masses[0] / masses[1] - 2.0).abs() < 0.02, "{masses:?}");
    assert!((masses[0] - 1693.0).abs() < 30.0, "{masses:?}");
    for command in ["check", "identify", "explain", "stops", "survey"] {
        let out = site.path().join("out").display().to_string();
        let out: &[&str] = if command == "survey" { &["--out", &out] } else { &[] };
        let of = |more: &[&str]| run(&site, &[&[command, &path][..], out, more].concat());
        let (code, _, errors) = of(&[]);
        assert!(code == Some(2) && errors.contains("holds trains 1, 2"), "{command}: {errors}");
        let (code, _, errors) = of(&["--train", "3"]);
        assert!(
            code == Some(2)
                && errors.contains("expected samples of train 3; those in it are of 1, 2"),
            "{command}: {errors}"
        );
    }
    // The demo has no places on the map: beyond the choice of the train, a survey says so.
    let out = site.path().join("out").display().to_string();
    let (_, _, errors) = run(&site, &["survey", &path, "--out", &out, "--train", "2"]);
    assert!(!errors.is_empty() && !errors.contains("train"), "{errors}");
}

#[test]
fn explain_grows_the_model_of_the_train_that_is_named() {
    let site = DaemonSite::new();
    let path = record(&site);
    let at = |name: &str| site.path().join(name).display().to_string();
    let (grown, annotated, report) = (at("grown"), at("annotated.mcap"), at("report.html"));
    let (code, _, errors) = run(
        &site,
        &[
            "explain",
            &path,
            "--train",
            "2",
            "--grown",
            &grown,
            "--annotate",
            &annotated,
            "--report",
            &report,
        ],
    );
    assert_eq!(code, Some(0), "{errors}");
    let train = std::fs::read_to_string(Path::new(&grown).join("train.toml")).expect("a train");
    assert!(train.contains("mass_t = 899.6"), "{train}");
    assert!(std::fs::read_to_string(report).expect("a report").contains("--train 2"));
    assert!(Path::new(&annotated).exists());
}

#[test]
fn a_replay_plays_the_train_that_is_named() {
    let site = DaemonSite::new();
    let path = record(&site);
    let config = site.write_config(
        2,
        "",
        "[[threads]]\nname = \"all\"\n[[pipelines]]\nkind = \"echo\"\nthread = \"all\"\n",
    );
    let _daemon = site.start(DYNOCAR, &["run", "--config", &config.display().to_string()]);
    let (code, _, errors) = run(&site, &["replay", &path, "--rate", "max", "--train", "2"]);
    assert_eq!(code, Some(0), "{errors}");
    assert!(errors.contains("20312 samples published"), "{errors}");
    let (code, _, errors) = run(&site, &["replay", &path, "--rate", "max"]);
    assert!(code == Some(2) && errors.contains("holds trains 1, 2"), "{errors}");
}

#[test]
fn a_dataset_of_one_train_has_none_to_choose() {
    let site = DaemonSite::new();
    let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo").display().to_string();
    for command in ["check", "identify", "explain", "stops"] {
        let (code, _, errors) = run(&site, &[command, &demo, "--train", "1"]);
        let words = "a dataset is of one train: --train chooses one of a recording";
        assert!(code == Some(2) && errors.contains(words), "{command}: {errors}");
    }
}
