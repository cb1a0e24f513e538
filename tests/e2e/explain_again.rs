//! The files of `dynocar explain --grown` are a dataset that can be explained without changes.

use std::path::Path;

use dynocar::dataset::{load, open};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::process::DaemonSite;
use dynocar_tests::simulator::dataset_writer::write_dataset;
use dynocar_tests::simulator::{
    Defects, EffectRequest, SimulatedDataset, SimulatorSettings, TrainType, TrueEffect, simulate,
};

use super::commands::{dynocar, said};

const SEED: u64 = 31;

/// Removes the file of a level line; the recordings state 0 ‰ instead.
fn without_a_line(folder: &Path) {
    std::fs::remove_file(folder.join("track.toml")).unwrap();
    let path = folder.join("dataset.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = text.replace("[track]\nfile = \"track.toml\"\n", "").replace(
        "[columns]\n",
        "[columns]\ngradient = { column = \"slope\", unit = \"permille\" }\n",
    );
    let delimiter = if text.contains("delimiter = \";\"") { ";" } else { "," };
    std::fs::write(&path, text).unwrap();
    for run in std::fs::read_dir(folder.join("runs")).unwrap().map(|it| it.unwrap().path()) {
        let text = std::fs::read_to_string(&run).unwrap();
        let added =
            |(row, line)| format!("{line}{delimiter}{}\n", if row == 0 { "slope" } else { "0" });
        std::fs::write(&run, text.lines().enumerate().map(added).collect::<String>()).unwrap();
    }
}

/// The command that a person is shown for explaining again.
fn shown_command(words: &str) -> Vec<String> {
    let line = words.lines().find_map(|line| line.split_once(": dynocar ")).expect("a command");
    line.1.split(' ').map(str::to_owned).collect()
}

/// A poor recording of places that resist in every run, on a line that nobody wrote down.
fn recorded(site: &DaemonSite) {
    let settings = |seed| SimulatorSettings {
        train_type: Some(TrainType::Regional),
        is_level_and_straight: true,
        defects: Defects::ALL,
        ..SimulatorSettings::new(seed, EffectRequest::Kinds(vec![EffectKind::LocalResistance]))
    };
    let is_in_every_run = |simulated: &SimulatedDataset| match &simulated.effects[..] {
        [TrueEffect::LocalResistance { runs, .. }] => runs.is_empty(),
        _ => false,
    };
    let mut drawn = (SEED..).map(|seed| simulate(&settings(seed)));
    let simulated = drawn.find(is_in_every_run).expect("one of many");
    let folder = site.path().join("day");
    write_dataset(&simulated, &folder).unwrap();
    without_a_line(&folder);
}

#[test]
fn a_place_that_resists_is_explained_once_where_no_line_was_declared() {
    let site = DaemonSite::new();
    recorded(&site);
    let first = dynocar(&site, &["explain", "day", "--grown", "found/grown", "--json", "a.json"]);
    let words = said(&first);
    assert!(first.status.success(), "{words}");
    assert!(!words.contains("cannot express"), "{words}");
    let answer = std::fs::read_to_string(site.path().join("a.json")).unwrap();
    let answer: serde_json::Value = serde_json::from_str(&answer).unwrap();
    assert_eq!(answer["effects"][0]["kind"], "local_resistance", "{}", answer["statement"]);

    let grown = load(&site.path().join("found/grown")).unwrap();
    let track = grown.track.as_ref().expect("a line's file made anew");
    assert!(track.resistance().is_some() && track.gradient().is_none());
    assert_eq!(grown.runs.len(), load(&site.path().join("day")).unwrap().runs.len());

    let again = shown_command(&words);
    assert_eq!(again, ["explain", "found/grown"]);
    let mut arguments: Vec<&str> = again.iter().map(String::as_str).collect();
    arguments.extend(["--json", "b.json"]);
    let second = dynocar(&site, &arguments);
    assert!(second.status.success(), "{}", said(&second));
    let answer = std::fs::read_to_string(site.path().join("b.json")).unwrap();
    let answer: serde_json::Value = serde_json::from_str(&answer).unwrap();
    let effects = answer["effects"].as_array().unwrap();
    let is_left = effects.iter().any(|effect| effect["kind"] == "local_resistance");
    assert!(!is_left, "{}", answer["statement"]);
}

#[test]
fn an_updated_dataset_names_runs_and_ways_where_they_lie_and_forgets_an_older_line() {
    let site = DaemonSite::new();
    let demo = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/demo");
    let old = "# Grown from track.toml of dataset.toml by `dynocar explain`.\n[track]\n";
    std::fs::create_dir_all(site.path().join("grown")).unwrap();
    site.write("grown/track.toml", old);
    let grow = dynocar(&site, &["explain", demo, "--grown", "grown", "--traction-only"]);
    assert!(grow.status.success(), "{}", said(&grow));
    assert_eq!(shown_command(&said(&grow)), ["explain", "grown", "--traction-only"]);
    let (folder, head) = open(&site.path().join("grown")).unwrap();
    for run in &head.manifest.runs {
        assert!(Path::new(&run.file).is_relative(), "{}", run.file);
        let (at, declared) = (folder.path_of(&run.file), Path::new(demo));
        assert!(at.canonicalize().unwrap().starts_with(declared.canonicalize().unwrap()));
    }
    let track = std::fs::read_to_string(site.path().join("grown/track.toml")).unwrap();
    assert!(track != old && head.track.is_some(), "the demo's line is known");

    let (declared, _) = open(Path::new(demo)).unwrap();
    let text = std::fs::read_to_string(declared.path_of("dataset.toml")).unwrap();
    let text = text.replace("\"runs/", &format!("\"{demo}/runs/"));
    let lines = text.lines().filter(|line| !line.contains("track"));
    std::fs::create_dir(site.path().join("lineless")).unwrap();
    site.write("lineless/dataset.toml", &lines.map(|line| format!("{line}\n")).collect::<String>());
    std::fs::copy(format!("{demo}/train.toml"), site.path().join("lineless/train.toml")).unwrap();
    let grow = dynocar(&site, &["explain", "lineless", "--grown", "grown"]);
    assert!(grow.status.success(), "{}", said(&grow));
    let (_, head) = open(&site.path().join("grown")).unwrap();
    let is_written = site.path().join("grown/track.toml").exists();
    assert_eq!(is_written, head.track.is_some(), "a line that is not known stays nowhere");
}
