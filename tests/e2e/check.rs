//! `dynocar check` as a user runs it: its output and its exit status.

use std::path::Path;
use std::process::{Command, Output};

const MANIFEST: &str = "[dataset]
name = \"shuttle\"
description = \"Two short runs, made by hand\"
position_reference = \"head\"
[train]
file = \"train.toml\"
[track]
file = \"track.toml\"
[columns]
time = { column = \"t\", unit = \"ms\" }
position = { column = \"s\", unit = \"m\" }
speed = { column = \"v\", unit = \"km/h\" }
traction_force = { column = \"F\", unit = \"kN\" }
brake_force = { column = \"B\", unit = \"kN\", scale = -1 }
[[runs]]
file = \"1.csv\"
[[runs]]
file = \"2.csv\"
role = \"holdout\"
direction = -1
mass_t = 104.5
";
const TRAIN: &str = "[train]
name = \"railcar\"
mass_t = 100
length_m = 50
cars = 2
rotating_mass_factor = 0.05
[resistance]
a = 1.5
b = 0.02
c = 0.0005
[traction]
effort = [[0, 100], [20, 60]]
";
const TRACK: &str = "[track]
name = \"branch\"
length_m = 5000
gradient = [[0, 3], [1000, -2.5]]
curves = [[400, 700, 300]]
";
const RUN_1: &str = "t,s,v,F,B
0,100,0,0,-40
1000,100,0,80,0
2000,102.5,18,80,0
3000,107.5,18,0,0
3000,107.5,18,0,0
6000,122.5,18,0,-40
7000,127.5,18,,
8000,132.5,18,0,0
9000,137.5,18,0,0
10000,142.5,18,0,0
11000,147.5,18,0,0
12000,152.5,18,0,0
";
const RUN_2: &str = "t,s,v,F,B
0,300,36,0,0
1000,290,36,0,0
2000,280,36,0,0
";

fn dataset(run_2: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let files = [
        ("dataset.toml", MANIFEST),
        ("train.toml", TRAIN),
        ("track.toml", TRACK),
        ("1.csv", RUN_1),
        ("2.csv", run_2),
        ("other.toml", "[settings]\n[more]\n"),
        (
            "daemon.toml",
            "[[trains]]\nid = 4\nfile = \"train.toml\"\n[[pipelines]]\nkind = \"rls\"\n",
        ),
    ];
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

fn check(folder: &Path, arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_dynocar-workshop-under-test");
    Command::new(program).current_dir(folder).arg("check").args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

const REPORT: &str = "dataset  shuttle
  Two short runs, made by hand

train    railcar
  mass        100 t, rotating-mass factor 0.05
  length      50 m, 2 cars
  resistance  w0 = 1.5 + 0.02 v + 0.0005 v² N/kN, v in m/s
              1.47 kN at 0 km/h, 1.72 kN at 36 km/h, 2.06 kN at 72 km/h
  in curves   600 / R N/kN, R in m
  in tunnels  none declared
  traction    up to 100 kN, 60 kN at 72 km/h (2 points)
  brake       not declared

track    branch
  length      5 km
  gradient    -2.5 to 3 ‰, 2 entries, km 0 to 1
  curves      1, 0.3 km in all, radius 300 to 300 m
  tunnels     not known

columns  position of the train's head
  time            't' in ms
  position        's' in m
  speed           'v' in km/h
  traction_force  'F' in kN
  brake_force     'B' * -1 in kN

runs     2: 1 to fit, 1 held out
  run  file   role     dir      t  from s  for s    km  km/h  standing  coasting  traction  braking  unknown
    1  1.csv  fit       +1  100.0     0.0   12.0  0.05  18.0         2         4         1        1        4
    2  2.csv  holdout   -1  104.5     0.0    2.0  0.02  36.0         -         2         -        -        -
  km/h is the top speed; standing to unknown are seconds

data
  run  rows  step s  gaps  longest s  rows missing  out of order  repeated  cells missing  outliers  refused
    1    12       1     1          3             2             -         1              2         -        1
    2     3       1     -          -             -             -         -              -         -        -

sources
  position    as recorded
  gradient    from the track
  traction    as recorded
  brake       as recorded

notes
  run 1: cells missing: traction_force 1, brake_force 1
  run 1: refused by validation: repeated 1 (in 1.csv:6, at 3 s)
";

#[test]
fn a_dataset_is_reported_in_full_on_standard_output() {
    let folder = dataset(RUN_2);
    for path in [".", "dataset.toml"] {
        let output = check(folder.path(), &[path]);
        assert_eq!(text(&output.stderr), "");
        assert_eq!(text(&output.stdout), REPORT);
        assert_eq!(output.status.code(), Some(0));
    }
}

#[test]
fn a_train_and_a_track_can_be_checked_alone() {
    let folder = dataset(RUN_2);
    let output = check(folder.path(), &["train.toml"]);
    assert_eq!(
        text(&output.stdout),
        &REPORT[REPORT.find("train").unwrap()..REPORT.find("\ntrack").unwrap()]
    );
    let output = check(folder.path(), &["track.toml"]);
    assert_eq!(
        text(&output.stdout),
        &REPORT[REPORT.find("track").unwrap()..REPORT.find("\ncolumns").unwrap()]
    );
    assert_eq!(output.status.code(), Some(0));
}

#[test]
fn what_an_updated_model_adds_is_reported_and_nothing_else() {
    let folder = dataset(RUN_2);
    let updated_train = format!(
        "{TRAIN}[corrections]\nspeed_scale = 0.985\nactuator_lag_s = 0.4\ntunnel_c_factor = 1.9\n\
         tunnel_dc_n_per_kn_per_mps2 = 0.0003\n\
         wind_plus_mps = -2.5\nbearing_delta_a_n_per_kn = 0.6\nbearing_tau_s = 420\n\
         ambient_w0_per_k = -0.004\n"
    );
    let grown_track = format!(
        "{TRACK}gradient_shift_m = -40\ngradient_error = [[0, 0.5], [900, -1]]\n\
         resistance = [[100, 200, 1.25], [300, 400, -0.5]]\nmasses = [[0, 900, 1, 1.04]]\n"
    );
    std::fs::write(folder.path().join("train.toml"), updated_train).unwrap();
    std::fs::write(folder.path().join("track.toml"), grown_track).unwrap();
    let output = check(folder.path(), &["train.toml"]);
    let report = text(&output.stdout);
    let expected = "  corrections measured over true speed 0.985
              forces build up with a time constant of 0.4 s
              1.9 c v² in tunnels
              c 0.0003 greater in tunnels
              headwind -2.5 m/s as the chainage grows
              +0.6 N/kN of cold bearings, fading in 420 s
              -0.4 % of w0 per kelvin above 288.15 K\n";
    assert!(report.ends_with(expected), "{report}");
    let output = check(folder.path(), &["track.toml"]);
    let report = text(&output.stdout);
    let expected = "  shift       the gradient lies -40 m further\n  \
                    error       the gradient lacks -1 to 0.5 ‰ at 2 chainages\n  \
                    resistance  further -0.5 to 1.25 N/kN at 2 places\n  \
                    masses      1.04 to 1.04 of the declared, 1 section\n";
    assert!(report.ends_with(expected), "{report}");

    let output = check(folder.path(), &[".", "--json", "-"]);
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["train"]["corrections"]["speed_scale"], 0.985);
    assert_eq!(answer["train"]["corrections"]["traction_gain"], 1.0);
    assert_eq!(answer["track"]["masses"], serde_json::json!([[0.0, 900.0, 1.0, 1.04]]));
    std::fs::write(folder.path().join("train.toml"), TRAIN).unwrap();
    let output = check(folder.path(), &["train.toml", "--json", "-"]);
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["train"]["corrections"], serde_json::Value::Null);
}

#[test]
fn a_broken_run_is_named_and_the_others_are_still_reported() {
    let folder = dataset("t,s,v,F,B\n0,0,x,0,0\n1,0,0,0,0\n");
    let output = check(folder.path(), &["."]);
    assert_eq!(output.status.code(), Some(2));
    let message = "./2.csv:2: column 'v': expected a number or an empty cell, got 'x'; for a line of units \
                   below the names set units_row = true in [dataset]";
    assert_eq!(text(&output.stderr), format!("dynocar: {message}\n"));
    let report = text(&output.stdout);
    assert!(report.contains("    1  1.csv  fit       +1  100.0"), "{report}");
    assert!(report.contains("    2  2.csv  holdout   -1  error\n"), "{report}");
    let note = message.replace("units below", "units\n    below");
    assert!(report.ends_with(&format!("  run 2: {note}\n")), "{report}");
}

#[test]
fn json_on_standard_output_stands_alone() {
    let folder = dataset(RUN_2);
    let output = check(folder.path(), &[".", "--json", "-"]);
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&answer["kind"], &answer["valid"]), (&"dataset".into(), &true.into()));
    let run = &answer["dataset"]["runs"][0];
    assert_eq!(run["quality"]["order"]["repeated"], 1);
    assert_eq!(run["quality"]["refused"][0]["reason"], "repeated");
    assert_eq!(run["gradient_source"], "track");
    assert_eq!(answer["train"]["mass_kg"], 100_000.0);
    assert_eq!(answer["track"]["gradient_range_permille"], serde_json::json!([-2.5, 3.0]));
    assert_eq!(answer["track"]["tunnels"], serde_json::Value::Null);
}

#[test]
fn json_in_a_file_comes_besides_the_report_also_when_something_is_wrong() {
    let folder = dataset("t\n");
    let output = check(folder.path(), &[".", "--json", "answer.json"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stdout).starts_with("dataset  shuttle\n"));
    let answer = std::fs::read(folder.path().join("answer.json")).unwrap();
    let answer: serde_json::Value = serde_json::from_slice(&answer).unwrap();
    assert_eq!(answer["valid"], false);
    let error = answer["dataset"]["runs"][1]["error"].as_str().unwrap();
    assert!(error.starts_with("./2.csv:1: unknown column 's' (for position in ./dataset.toml:11)"));
    let output = check(folder.path(), &["nowhere", "--json", "-"]);
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["errors"][0], "nowhere: no such file or folder");
}

#[test]
fn what_is_no_dataset_is_refused_with_what_was_expected() {
    let folder = dataset(RUN_2);
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    let expected = "expected a dataset's folder or its dataset.toml (with a table [dataset]), a \
                    train.toml ([train]), a track.toml ([track]) or a daemon.toml ([trains] and \
                    [pipelines])\n";
    let cases = [
        ("empty", "empty: not a dataset: the folder holds no dataset.toml; "),
        ("1.csv", "1.csv: not a TOML file; "),
        ("other.toml", "other.toml: not a file that can be checked: it holds [settings], [more]; "),
    ];
    for (path, message) in cases {
        let output = check(folder.path(), &[path]);
        assert_eq!(text(&output.stderr), format!("dynocar: {message}{expected}"));
        assert_eq!((text(&output.stdout), output.status.code()), ("", Some(2)));
    }
}

#[test]
fn a_daemon_configuration_is_reported_with_its_pipelines_or_refused_with_key_and_range() {
    let folder = dataset(RUN_2);
    let output = check(folder.path(), &["daemon.toml", "--json", "-"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["kind"], "daemon");
    assert_eq!(answer["daemon"]["trains"][0]["id"], 4);
    assert_eq!(answer["daemon"]["pipelines"][0]["kind"], "rls");

    let config = std::fs::read_to_string(folder.path().join("daemon.toml")).unwrap();
    let wrong = config + "settings = { forgetting = 7.5 }\n";
    std::fs::write(folder.path().join("daemon.toml"), wrong).unwrap();
    let output = check(folder.path(), &["daemon.toml"]);
    assert_eq!(output.status.code(), Some(2));
    let message = text(&output.stderr);
    assert!(message.contains("pipelines.rls.settings.forgetting = 7.5: expected"), "{message}");
}
