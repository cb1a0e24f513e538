//! `dynocar init`: a first description of a train and of recordings without one.

use std::fs::{create_dir_all, read_to_string};
use std::path::Path;

use dynocar::dataset::open;
use dynocar_analysis::dataset::manifest::Manifest;
use dynocar_tests::process::DaemonSite;
use dynocar_tests::simulator::dataset_writer::dataset_files;
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, simulate};
use serde_json::Value;

#[path = "init/asked.rs"]
mod asked;
use crate::commands::{done, dynocar, run, said};

const DEMO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/demo");

/// Returns the columns of a manifest: quantity, column, unit and factor.
fn columns(manifest: &Manifest) -> Vec<(String, String, &'static str, f64)> {
    let columns = manifest.columns.iter();
    columns
        .map(|it| (it.quantity.to_string(), it.column.clone(), it.unit.name(), it.scale))
        .collect()
}

#[test]
fn the_demos_recordings_are_described_as_they_are_by_hand() {
    let site = DaemonSite::new();
    let runs = ["01", "02", "03", "06"].map(|name| format!("{DEMO}/runs/{name}.csv"));
    let mut arguments = vec!["init", "train", "--mass-t", "1755", "--csv"];
    arguments.extend(runs.iter().map(String::as_str));
    let printed = done(&site, &arguments);
    for words in
        ["brake_pressure_pa", "not mapped", "next, once", "dynocar check train/dataset.toml"]
    {
        let is_there = printed.contains(words);
        assert_eq!(is_there, words != "not mapped", "{words}: {printed}");
    }
    let (_, made) = open(&site.path().join("train")).unwrap();
    let (_, by_hand) = open(Path::new(DEMO)).unwrap();
    assert_eq!(columns(&made.manifest), columns(&by_hand.manifest));
    let facts = |manifest: &Manifest| -> Vec<i8> {
        manifest.runs.iter().map(|run| run.direction).collect()
    };
    assert_eq!(facts(&made.manifest), facts(&by_hand.manifest));
    let roles: Vec<&str> = made.manifest.runs.iter().map(|run| run.role.name()).collect();
    assert_eq!(roles, ["fit", "fit", "fit", "holdout"]);
    done(&site, &["check", "train"]);
    done(&site, &["check", "train/train.toml"]);
    done(&site, &["check", "train/daemon.toml"]);
}

#[test]
fn marks_that_are_stated_are_taken_and_written() {
    let site = DaemonSite::new();
    let rows =
        |cells: &str| (0..9).map(|it| cells.replace('~', &it.to_string())).collect::<String>();
    let cases = [
        ("t#v [km/h]\n", "1,~#2.500,5\n", ["#", ","], Some('.')),
        ("t [s];v [m/s]\n", "~;1,50~\n", [";", "."], Some(',')),
        ("t [s]\tv [m/s]\n", "~\t1,5\n", ["\\t", ","], None),
    ];
    for (at, (header, cells, [delimiter, decimal], thousands)) in cases.into_iter().enumerate() {
        let text = header.to_owned() + &rows(cells);
        site.write("a.csv", &text);
        let folder = format!("made{at}");
        let marks = ["--delimiter", delimiter, "--decimal", decimal];
        done(&site, &[&["init", &folder, "--csv", "a.csv"], &marks[..]].concat());
        let made = open(&site.path().join(&folder)).unwrap().1.manifest.layout;
        let mark = if delimiter == "\\t" { b'\t' } else { delimiter.as_bytes()[0] };
        assert_eq!((made.delimiter, made.decimal), (mark, decimal.as_bytes()[0]), "{text}");
        assert_eq!(made.thousands, thousands, "{text}");
    }
}

#[test]
fn recordings_of_five_houses_in_any_unit_are_described_as_they_were_written() {
    let (mut right, mut wrong) = (0, Vec::new());
    for seed in 1..=24 {
        let settings = SimulatorSettings {
            runs: 2,
            holdout_runs: 1,
            duration_s: 900.0,
            ..SimulatorSettings::new(seed, EffectRequest::none())
        };
        let dataset = simulate(&settings);
        let site = DaemonSite::new();
        create_dir_all(site.path().join("runs")).unwrap();
        let mut arguments = vec!["init".to_string(), "made".into()];
        let files = dataset_files(&dataset);
        let mass_t = format!("{}", dataset.declared_train().mass_kg / 1000.0);
        arguments.extend(["--mass-t".into(), mass_t, "--csv".into()]);
        for (name, text) in files.iter().filter(|(name, _)| name.ends_with(".csv")) {
            site.write(name, text);
            arguments.push(name.clone());
        }
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let printed = done(&site, &arguments);
        let (_, made) = open(&site.path().join("made")).unwrap();
        let truth = &files.iter().find(|(name, _)| name == "dataset.toml").unwrap().1;
        let truth = Manifest::parse("dataset.toml", truth).unwrap();
        let made = columns(&made.manifest);
        for column in columns(&truth) {
            let is_right = made.contains(&column);
            right += usize::from(is_right);
            if !is_right {
                let is_doubted = printed.contains(&format!("doubtful: {}:", column.0));
                let left_out = printed.contains(&format!("not mapped: '{}'", column.1));
                assert!(
                    is_doubted || left_out,
                    "seed {seed}: {column:?} is wrong, sure:\n{printed}"
                );
                wrong.push(format!("seed {seed}: {column:?}"));
            }
        }
        assert!(
            made.len() <= columns(&truth).len(),
            "seed {seed}: something is made up:\n{printed}"
        );
        done(&site, &["check", "made"]);
    }
    assert!(right > 100, "{right} columns");
    // Columns that no name gives and no motion reveals stay open: °F, and counts of a thousandth.
    assert!(wrong.len() * 15 <= right, "{right} right, wrong: {wrong:#?}");
}

#[test]
fn a_unit_that_no_name_gives_is_set_right_by_how_the_train_moves() {
    let site = DaemonSite::new();
    // Up to 40 km/h: by their range alone these speeds would be m/s.
    let mut position_m = 0.0;
    let slow: String = run("t,v,s")
        .lines()
        .enumerate()
        .map(|(row, line)| {
            let cells: Vec<&str> = line.split(',').collect();
            if row == 0 {
                return "t,v,s [m]\n".to_string();
            }
            let kmh: f64 = cells[1].parse::<f64>().unwrap() / 4.0;
            position_m += kmh / 3.6;
            format!("{},{kmh:.3},{position_m:.2}\n", cells[0])
        })
        .collect();
    site.write("slow.csv", &slow);
    let printed = done(&site, &["init", "made", "--csv", "slow.csv"]);
    let text = read_to_string(site.path().join("made/dataset.toml")).unwrap();
    let mapping = "speed = { column = \"v\", unit = \"km/h\", doubtful = true }";
    assert!(text.contains(mapping), "{text}");
    assert!(
        printed.contains("doubtful: speed: the name gives no unit; km/h, since in m/s"),
        "{printed}"
    );
}

#[test]
fn without_recordings_train_and_configuration_are_written_and_pass_the_check() {
    let site = DaemonSite::new();
    let printed = done(&site, &["init", "a new/train", "--name", "S 7", "--mass-t", "114.5"]);
    assert!(
        printed.contains("defaults in train.toml, nobody's figures: length_m = 57.25"),
        "{printed}"
    );
    assert!(printed.contains("dynocar run --config 'a new/train/daemon.toml'"), "{printed}");
    let train = done(&site, &["check", "a new/train/train.toml"]);
    assert!(train.contains("S 7") && train.contains("114.5"), "{train}");
    done(&site, &["check", "a new/train/daemon.toml"]);
    assert!(!site.path().join("a new/train/dataset.toml").exists());
}

#[test]
fn a_line_that_is_there_is_taken_up() {
    let site = DaemonSite::new();
    create_dir_all(site.path().join("made")).unwrap();
    site.write("made/track.toml", "[track]\ngradient = [[0.0, 3.0]]\n");
    site.write("a.csv", &run("t,v [km/h],F [kN],x"));
    done(&site, &["init", "made", "--csv", "a.csv", "--mass-t", "100"]);
    let json = done(&site, &["check", "made", "--json", "-"]);
    let answer: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(answer["track"]["gradients"], 1, "{}", answer["track"]);
    assert!(done(&site, &["check", "made/daemon.toml"]).contains("unnamed line"));
    let broken = DaemonSite::new();
    create_dir_all(broken.path().join("made")).unwrap();
    broken.write("made/track.toml", "[track]\nlength = 3\n");
    broken.write("a.csv", &run("t,v [km/h],F [kN],x"));
    let output = dynocar(&broken, &["init", "made", "--csv", "a.csv"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("track.toml:2: unknown key 'length'"), "{}", said(&output));
}
