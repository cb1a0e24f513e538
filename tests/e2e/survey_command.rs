//! `dynocar survey` as a person uses it: a line, new recordings on it, and recordings that cannot be surveyed.

use std::fs::{create_dir_all, read_to_string, write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use dynocar_tests::browser::Browser;
use dynocar_tests::simulator::dataset_writer::write_dataset;
use dynocar_tests::simulator::{
    EffectRequest, GnssReceiver, SimulatorSettings, TrainType, simulate,
};
use serde_json::Value;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");

/// Raw recordings of a railway, and its line as surveyed from them.
struct Surveyed {
    folder: tempfile::TempDir,
    answer: Value,
}

impl Surveyed {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

/// Returns four short runs in both directions, three of them to fit; all tests share them.
fn surveyed() -> &'static Surveyed {
    static SURVEYED: OnceLock<Surveyed> = OnceLock::new();
    SURVEYED.get_or_init(|| {
        let settings = SimulatorSettings {
            train_type: Some(TrainType::Metro),
            runs: 4,
            holdout_runs: 1,
            duration_s: 600.0,
            gnss: Some(GnssReceiver::USUAL),
            ..SimulatorSettings::new(5, EffectRequest::none())
        };
        let folder = tempfile::tempdir().unwrap();
        let (raw, out) = (folder.path().join("raw"), folder.path().join("line"));
        write_dataset(&simulate(&settings), &raw).unwrap();
        let report = folder.path().join("line.html");
        let output = survey(&raw, &out, &["--json", "-", "--report", report.to_str().unwrap()]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        Surveyed { folder, answer: serde_json::from_slice(&output.stdout).unwrap() }
    })
}

fn survey(source: &Path, out: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(DYNOCAR);
    command.arg("survey").arg(source).arg("--out").arg(out).args(more);
    command.output().unwrap()
}

/// Standard error of a survey that must end with status 2 and leave no dataset.
fn refusal(source: &Path, more: &[&str]) -> String {
    let out = tempfile::tempdir().unwrap();
    let output = survey(source, out.path(), more);
    let words = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{words}");
    assert!(!out.path().join("dataset.toml").exists());
    words
}

/// A folder with the raw recordings, the text of some of its files changed.
fn changed(change: &dyn Fn(&str, String) -> String) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let raw = surveyed().path("raw");
    create_dir_all(folder.path().join("runs")).unwrap();
    for part in ["", "runs"] {
        for entry in raw.join(part).read_dir().unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                let name = Path::new(part).join(path.file_name().unwrap());
                let text = change(name.to_str().unwrap(), read_to_string(&path).unwrap());
                write(folder.path().join(name), text).unwrap();
            }
        }
    }
    folder
}

#[test]
fn a_closed_pipe_ends_it_quietly_and_a_full_disk_is_reported() {
    let (raw, out) = (surveyed().path("raw"), tempfile::tempdir().unwrap());
    let printed = |standard_output: Stdio| {
        let mut command = Command::new(DYNOCAR);
        command.arg("survey").arg(&raw).arg("--out").arg(out.path().join("line"));
        let output = command.stdout(standard_output).stderr(Stdio::piped()).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (_, writer) = std::io::pipe().unwrap();
    let (status, words) = printed(writer.into());
    assert!(status == Some(0) && !words.contains("panicked"), "{status:?}: {words}");
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let (status, words) = printed(full.into());
    assert!(status == Some(1) && words.contains("cannot be written"), "{status:?}: {words}");
}

#[test]
fn new_recordings_are_mapped_on_a_line_surveyed_before_as_they_were_on_it() {
    let first = surveyed();
    let (raw, line) = (first.path("raw"), first.path("line/track.toml"));
    let out = first.path("mapped");
    let output = survey(&raw, &out, &["--line", line.to_str().unwrap(), "--json", "-"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mapped: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(mapped.get("learned").is_none());
    let trips = |answer: &Value| answer["trips"].as_array().unwrap().len();
    assert_eq!(trips(&mapped), trips(&first.answer));
    assert_eq!(read_to_string(out.join("track.toml")).unwrap(), read_to_string(line).unwrap());
    let positions = |folder: &Path| -> Vec<(String, f64)> {
        let text = read_to_string(folder.join("runs/001.csv")).unwrap();
        let cells = text.lines().skip(1).map(|row| row.split(',').take(2).map(String::from));
        cells.map(|mut row| (row.next().unwrap(), row.next().unwrap().parse().unwrap())).collect()
    };
    let (known, learned) = (positions(&out), positions(&first.path("line")));
    assert!(known.len() > 500);
    for (time, position_m) in &known {
        if let Some(other) = learned.iter().find(|it| it.0 == *time) {
            assert!((position_m - other.1).abs() < 8.0, "{time} s: {position_m} m, {} m", other.1);
        }
    }
}

#[test]
fn what_cannot_be_surveyed_is_refused_in_words() {
    let without = changed(&|name, text| match name {
        "dataset.toml" => {
            let is_place =
                |line: &&str| line.starts_with("latitude") || line.starts_with("longitude");
            text.lines().filter(|line| !is_place(line)).map(|line| format!("{line}\n")).collect()
        }
        _ => text,
    });
    let words = refusal(without.path(), &[]);
    assert!(words.contains("expected recordings with latitude and longitude"), "{words}");
    let cut = changed(&|name, text| match name.starts_with("runs/") {
        true => text[..10].into(),
        false => text,
    });
    let words = refusal(cut.path(), &[]);
    assert!(words.contains(".csv:"), "{words}");
    let held_out = changed(&|_, text| text.replace("role = \"fit\"", "role = \"holdout\""));
    let words = refusal(held_out.path(), &[]);
    assert!(words.contains("fit"), "{words}");
}

#[test]
fn runs_that_end_in_the_middle_of_a_row_are_surveyed_as_far_as_they_go() {
    let cut = changed(&|name, text| match name.starts_with("runs/") {
        true => text[..text.len() * 4 / 5].into(),
        false => text,
    });
    let out = tempfile::tempdir().unwrap();
    let output = survey(cut.path(), out.path(), &["--json", "-"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(!answer["trips"].as_array().unwrap().is_empty());
}

#[test]
fn a_line_that_is_none_is_refused_in_words() {
    let first = surveyed();
    let raw = first.path("raw");
    let line = |text: String, alignment: Option<&str>| {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path().join("track.toml"), text).unwrap();
        if let Some(alignment) = alignment {
            write(folder.path().join("alignment.csv"), alignment).unwrap();
        }
        folder
    };
    let refused = |folder: &tempfile::TempDir| {
        refusal(&raw, &["--line", folder.path().join("track.toml").to_str().unwrap()])
    };
    let track: String = read_to_string(first.path("line/track.toml"))
        .unwrap()
        .lines()
        .filter(|line| !line.starts_with("alignment_falling"))
        .map(|line| format!("{line}\n"))
        .collect();
    let words = refusal(&raw, &["--line", "/no/such/track.toml"]);
    assert!(words.contains("/no/such/track.toml"), "{words}");
    let words = refused(&line(track.replace("alignment =", "# alignment ="), None));
    assert!(words.contains("expected alignment = \"…csv\""), "{words}");
    let head = "chainage_m,latitude_deg,longitude_deg\n";
    let words = refused(&line(track.clone(), Some(&format!("{head}0,47,9\nten,47,9\n"))));
    assert!(words.contains("alignment.csv: line 3: expected chainage_m"), "{words}");
    let words = refused(&line(track.clone(), Some(head)));
    assert!(words.contains("expected two places or more"), "{words}");
    let elsewhere = format!("{head}0,10,10\n500,10,10.0045\n1000,10,10.009\n");
    let words = refused(&line(track, Some(&elsewhere)));
    assert!(words.contains("no recording runs along it"), "{words}");
}

#[test]
fn one_pass_makes_a_line_and_says_what_it_cannot_determine() {
    let one = changed(&|name, text| match name {
        "dataset.toml" => text[..text.match_indices("[[runs]]").nth(1).unwrap().0].into(),
        _ => text,
    });
    let out = tempfile::tempdir().unwrap();
    let output = survey(one.path(), out.path(), &["--json", "-"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let open = answer["cannot_tell"].to_string();
    assert!(open.contains("one pass cannot be left out"), "{open}");
    assert!(open.contains("mean gradient"), "{open}");
}

#[test]
fn the_page_shows_map_profile_and_every_trip_and_asks_for_nothing() {
    let page = surveyed().path("line.html");
    let mut browser = Browser::start(390, true);
    browser.open(&format!("file://{}", page.display()));
    let trips = surveyed().answer["trips"].as_array().unwrap().len();
    assert_eq!(browser.value("document.querySelectorAll('#trips tbody tr').length"), trips);
    for drawn in ["#map path", "#map circle", "#profile polygon", "#profile polyline"] {
        let count = browser.value(&format!("document.querySelectorAll('{drawn}').length"));
        assert!(count.as_u64().unwrap() > 0, "{drawn}");
    }
    let wide = "document.documentElement.scrollWidth <= document.documentElement.clientWidth";
    assert_eq!(browser.value(wide), true);
    let conduct = browser.conduct();
    assert!(conduct.console_errors.is_empty(), "{:?}", conduct.console_errors);
    assert_eq!(conduct.requests.len(), 1, "{:?}", conduct.requests);
}

#[test]
fn the_line_reaches_beyond_the_last_stop() {
    let survey = surveyed();
    let line = &survey.answer["line"];
    let stops = line["stops"].as_array().unwrap().iter();
    let last_m = stops.map(|it| it["chainage_m"].as_f64().unwrap()).fold(0.0, f64::max);
    assert!(last_m > 0.0 && last_m < line["length_m"].as_f64().unwrap(), "{line}");
    let text = read_to_string(survey.path("line/track.toml")).unwrap();
    let track = dynocar_analysis::dataset::parse_track("track.toml", &text).unwrap();
    assert!(track.length_m.unwrap() > last_m);
}
