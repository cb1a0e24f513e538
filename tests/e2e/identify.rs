//! `dynocar identify` as a user runs it on single runs.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

use dynocar_analysis::identify::default_estimators;

const MANIFEST: &str = "[dataset]
name = \"shuttle\"
[train]
file = \"train.toml\"
[columns]
time = { column = \"t\", unit = \"s\" }
speed = { column = \"v\", unit = \"m/s\" }
gradient = { column = \"i\", unit = \"permille\" }
control_force = { column = \"F\", unit = \"kN\" }
[[runs]]
file = \"light.csv\"
[[runs]]
file = \"heavy.csv\"
role = \"holdout\"
";
const TRAIN: &str = "[train]
name = \"railcar\"
mass_t = 100
length_m = 50
rotating_mass_factor = 0.05
[resistance]
a = 1.5
b = 0.02
c = 0.0005
";

/// The brake gear of a CRH3 (Xie 2019, table 1).
const GEAR: &str = "[brake]
max_force_kn = 60
cylinder_diameter_mm = 203
disc_radius_mm = 297.6
wheel_radius_mm = 460
efficiency = 0.85
ratio = 2.55
friction = 0.28
pads = 8
";

/// A run of a train of some mass that pulls, coasts and pulls again, its brake released; 10 Hz, no
/// noise.
fn run(mass_kg: f64) -> String {
    let mut text = String::from("t,v,i,F,p\n");
    let (step_s, mut speed_mps) = (0.1, 0.0);
    for k in 0..3000 {
        let force_n: f64 = if (k / 600) % 2 == 0 { 60e3 - 5.0 * f64::from(k % 600) } else { 0.0 };
        writeln!(text, "{:.1},{speed_mps:.6},0,{:.3},0", step_s * f64::from(k), force_n / 1e3)
            .unwrap();
        let w0 = 1.5 + 0.02 * speed_mps + 0.0005 * speed_mps * speed_mps;
        let resistance_n = mass_kg * 9.81e-3 * w0;
        speed_mps += step_s * (force_n - resistance_n) / (1.05 * mass_kg);
    }
    text
}

fn write_dataset(folder: &Path, manifest: &str, train: &str) {
    for (name, text) in [
        ("dataset.toml", manifest),
        ("train.toml", train),
        ("light.csv", &run(100e3)),
        ("heavy.csv", &run(112e3)),
    ] {
        std::fs::write(folder.join(name), text).unwrap();
    }
}

/// Runs the command over the dataset in a folder.
fn asked(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dynocar-workshop-under-test"));
    command.current_dir(folder).args(["identify", "."]).args(arguments).output().unwrap()
}

/// Returns the names of the estimators that ran, and of those that did not.
fn ran(folder: &Path, arguments: &[&str]) -> [Vec<String>; 2] {
    let output = asked(folder, &[arguments, &["--json", "-"]].concat());
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let names = |key: &str, name: fn(&serde_json::Value) -> &serde_json::Value| {
        let entries = answer[key].as_array().unwrap();
        entries.iter().map(|it| name(it).as_str().unwrap().to_owned()).collect()
    };
    [names("estimators", |it| &it["name"]), names("not_run", |it| it)]
}

fn identify(folder: &Path, arguments: &[&str]) -> Output {
    write_dataset(folder, MANIFEST, TRAIN);
    asked(folder, &[&["--estimator", "mass_kalman"], arguments].concat())
}

#[test]
fn the_recommended_estimators_run_that_the_train_and_the_recordings_permit() {
    let folder = tempfile::tempdir().unwrap();
    let recommended = dynocar_fmu::estimators::PIPELINES.map(|kind| kind.name());
    let without_brake: Vec<_> =
        recommended.iter().filter(|&&it| it != "brake_smoother").copied().collect();
    let with_pressure = MANIFEST.replace(
        "[[runs]]\nfile = \"light",
        "brake_cylinder_pressure = { column = \"p\", unit = \"kPa\" }\n[[runs]]\nfile = \"light",
    );
    let with_gear = format!("{TRAIN}{GEAR}");
    let all = default_estimators();
    for (manifest, train, expected) in [
        (MANIFEST, TRAIN, without_brake.as_slice()),
        (MANIFEST, &with_gear, &without_brake),
        (&with_pressure, TRAIN, &without_brake),
        (&with_pressure, &with_gear, &recommended),
    ] {
        write_dataset(folder.path(), manifest, train);
        let [estimators, not_run] = ran(folder.path(), &[]);
        assert_eq!(estimators, expected);
        let others = all.iter().map(|it| it.kind().name()).filter(|it| !expected.contains(it));
        assert!(not_run.iter().eq(others), "{not_run:?}");
    }
    let text = String::from_utf8(asked(folder.path(), &[]).stdout).unwrap();
    assert!(text.contains("\nnot run: ls, ") && text.contains("; --all runs them"), "{text}");
}

#[test]
fn of_data_that_cannot_be_true_no_value_is_printed() {
    let folder = tempfile::tempdir().unwrap();
    write_dataset(folder.path(), &MANIFEST.replace("\"kN\"", "\"N\""), TRAIN);
    let text = String::from_utf8(asked(folder.path(), &[]).stdout).unwrap();
    assert!(text.contains("No value is printed") && !text.contains('±'), "{text}");
    write_dataset(folder.path(), MANIFEST, TRAIN);
    let text = String::from_utf8(asked(folder.path(), &[]).stdout).unwrap();
    assert!(text.contains('±') && text.contains(" t\n") && text.contains(" N/kN\n"), "{text}");
}

#[test]
fn all_estimators_or_those_named_run_when_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    write_dataset(folder.path(), MANIFEST, TRAIN);
    let [all, not_run] = ran(folder.path(), &["--all"]);
    assert!(all.iter().eq(default_estimators().iter().map(|it| it.kind().name())), "{all:?}");
    assert!(not_run.is_empty());
    let named = ["--estimator", "rls", "--estimator", "mass_kalman", "--estimator", "rls"];
    assert_eq!(ran(folder.path(), &named), [vec!["rls", "mass_kalman"], vec![]]);
    for (arguments, expected) in [
        (
            ["--estimator", "rls", "--estimator", "guess"].as_slice(),
            "guess: expected one of ls, rls, ",
        ),
        (&["--all", "--estimator", "rls"], "--all: expected no --estimator with it, got rls"),
    ] {
        let output = asked(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        let words = String::from_utf8(output.stderr).unwrap();
        assert!(words.contains(expected), "{words}");
    }
}

#[test]
fn each_run_is_learned_from_alone_and_their_difference_shows() {
    let folder = tempfile::tempdir().unwrap();
    let output = identify(folder.path(), &["--per-run", "--json", "-"]);
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let runs = answer["runs"].as_array().unwrap();
    assert_eq!((&runs[0]["file"], &runs[1]["role"]), (&"light.csv".into(), &"holdout".into()));
    let mass_t = |run: usize| runs[run]["estimators"][0]["values"]["mass_t"].as_f64().unwrap();
    assert!((mass_t(0) - 100.0).abs() < 1.0, "{}", mass_t(0));
    assert!((mass_t(1) - 112.0).abs() < 1.0, "{}", mass_t(1));
    assert_eq!(runs[0]["declared_mass_t"], 100.0);
    let spread = &answer["between_runs"][0]["parameters"]["mass_t"];
    let between = spread["std_between"].as_f64().unwrap();
    assert!((between - (mass_t(1) - mass_t(0)) / 2.0_f64.sqrt()).abs() < 1e-9);
    assert!(between > 5.0 * spread["std_stated"].as_f64().unwrap(), "{spread}");
}

#[test]
fn runs_that_end_at_a_stop_say_the_mass_that_arrived() {
    let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo");
    let arguments = ["identify", "--estimator", "train_kalman", "--json", "-"];
    let mut command = Command::new(env!("CARGO_BIN_EXE_dynocar-workshop-under-test"));
    let output = command.args(arguments).arg(&demo).output().unwrap();
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let said = &answer["estimators"][0];
    assert_eq!(said["reason"], "none", "{said}");
    let share =
        said["std"]["mass_t"].as_f64().unwrap() / said["values"]["mass_t"].as_f64().unwrap();
    assert!(share < 0.02, "{share}");
}

#[test]
fn the_table_of_runs_comes_only_when_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let text = |output: &Output| String::from_utf8(output.stdout.clone()).unwrap();
    let with = text(&identify(folder.path(), &["--per-run"]));
    let table = with.split_once("mass_kalman, from each run alone\n").expect("a table").1;
    let rows: Vec<&str> = table.lines().collect();
    assert!(rows[0].contains("declared t") && rows[0].contains("mass_t"), "{with}");
    assert!(rows[1].contains("light.csv") && rows[2].contains("heavy.csv"), "{with}");
    assert!(with.contains("mass_t: mean 10") && with.contains(" of 2 runs; "), "{with}");
    let without = text(&identify(folder.path(), &[]));
    assert!(!without.contains("from each run alone"), "{without}");
}

#[test]
fn traction_only_takes_the_force_of_coasting_and_braking_for_unknown() {
    let folder = tempfile::tempdir().unwrap();
    let missing = |arguments: &[&str]| {
        let output = identify(folder.path(), arguments);
        let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        answer["estimators"][0]["samples"]["rejected"]["missing"].as_u64()
    };
    assert_eq!(missing(&["--json", "-"]), None);
    // Both runs coast in 1200 of their 3000 samples.
    assert_eq!(missing(&["--traction-only", "--json", "-"]), Some(2400));
}
