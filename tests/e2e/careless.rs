//! Mistakes of a careless first user: wrong paths, wrong kinds of files, recordings that lack data. Every command
//! describes the mistake and ends.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::process::{Command, Output};

use dynocar_tests::process::DaemonSite;
use serde_json::Value;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");

const MANIFEST: &str = "[dataset]\nname = \"x\"\n[train]\nfile = \"train.toml\"\n[columns]\n\
    time = { column = \"t\", unit = \"s\" }\nspeed = { column = \"v\", unit = \"m/s\" }\n\
    control_force = { column = \"F\", unit = \"kN\" }\n\
    gradient = { column = \"i\", unit = \"permille\" }\n[[runs]]\nfile = \"1.csv\"\n";
const TRAIN: &str = "[train]\nmass_t = 100\nlength_m = 80\nrotating_mass_factor = 0.05\n\
    [resistance]\na = 1\nb = 0.02\nc = 0.0004\n";

/// A run with traction, coasting and braking, ten minutes at 1 Hz.
fn run() -> String {
    let (mut text, mut speed_mps) = (String::from("t,v,F,i\n"), 0.0_f64);
    for second in 0..600 {
        let force_kn = match second {
            0..200 => 60.0,
            200..500 => 0.0,
            _ if speed_mps > 1.0 => -30.0,
            _ => 0.0,
        };
        writeln!(text, "{second},{speed_mps:.3},{force_kn},0").unwrap();
        let w0 = 1.0 + 0.02 * speed_mps + 0.0004 * speed_mps * speed_mps;
        speed_mps = (speed_mps + (force_kn - 0.981 * w0) / 105.0).max(0.0);
    }
    text
}

fn dataset(site: &DaemonSite, manifest: &str, run: &[u8]) -> String {
    site.write("dataset.toml", manifest);
    site.write("train.toml", TRAIN);
    std::fs::write(site.path().join("1.csv"), run).unwrap();
    site.path().display().to_string()
}

/// Standard error of a command that must end with status 2 within the watchdog's time.
fn refusal(site: &DaemonSite, arguments: &[&str]) -> String {
    let mut process = site.start(DYNOCAR, arguments);
    let status = process.wait();
    assert_eq!(status.code(), Some(2), "{arguments:?}: {}", process.errors());
    process.errors()
}

fn finished(arguments: &[&OsStr]) -> Output {
    Command::new(DYNOCAR).args(arguments).output().unwrap()
}

#[test]
fn a_pipe_or_device_in_the_place_of_a_file_is_refused_by_every_command() {
    let site = DaemonSite::new();
    let folder = dataset(&site, MANIFEST, b"");
    let (run, manifest) = (site.path().join("1.csv"), site.path().join("dataset.toml"));
    std::fs::remove_file(&run).unwrap();
    let make_pipe = |path: &Path| {
        assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
    };
    make_pipe(&run);
    for verb in ["check", "identify", "explain", "replay"] {
        let message = refusal(&site, &[verb, &folder]);
        let words = format!("dataset.toml:10: {}: expected a file, found a pipe\n", run.display());
        assert!(message.ends_with(&words), "{verb}: {message}");
    }
    std::fs::remove_file(&manifest).unwrap();
    make_pipe(&manifest);
    let pipe = manifest.to_str().unwrap();
    let cases: [&[&str]; 6] = [
        &["check", pipe],
        &["check", &folder],
        &["identify", &folder],
        &["explain", pipe],
        &["run", "--config", pipe],
        &["health", "--config", pipe],
    ];
    for arguments in cases {
        let message = refusal(&site, arguments);
        assert_eq!(message, format!("dynocar: {pipe}: expected a file, found a pipe\n"));
    }
    let message = refusal(&site, &["run", "--config", "/dev/zero"]);
    assert_eq!(message, "dynocar: /dev/zero: expected a file, found a device\n");
    let message = refusal(&site, &["run", "--config", &folder]);
    assert_eq!(message, format!("dynocar: {folder}: expected a file, found a folder\n"));
}

#[test]
fn a_file_of_another_format_is_named_with_what_to_do() {
    let site = DaemonSite::new();
    let utf16: Vec<u8> = run().encode_utf16().flat_map(u16::to_le_bytes).collect();
    let with_mark = [&[0xff, 0xfe], &utf16[..]].concat();
    let cases: [(&[u8], &str); 6] = [
        (&[0x1f, 0x8b, 8, 0, 0, 0, 0], "a gzip file: unpack it first"),
        (b"PK\x03\x04abc", "a zip file or a workbook: unpack it, or save the sheet as CSV"),
        (&with_mark, "set encoding = \"utf-16le\" in [dataset]"),
        (&utf16, "set encoding = \"utf-16le\" in [dataset]"),
        (&[0; 5000], "binary data"),
        (b"t,v\n0,\xb0\n", "set its own encoding in [dataset], as encoding = \"windows-1252\""),
    ];
    for (bytes, words) in cases {
        let folder = dataset(&site, MANIFEST, bytes);
        for verb in ["check", "explain"] {
            let message = refusal(&site, &[verb, &folder]);
            assert!(message.ends_with(&format!("{words}\n")), "{verb}: {message}");
            assert!(message.contains("1.csv"), "{verb}: {message}");
        }
    }
}

#[test]
fn a_file_longer_than_memory_is_refused_before_it_is_read() {
    let site = DaemonSite::new();
    let folder = dataset(&site, MANIFEST, run().as_bytes());
    let file = std::fs::OpenOptions::new().write(true).open(site.path().join("1.csv")).unwrap();
    file.set_len(1 << 40).unwrap();
    let message = refusal(&site, &["check", &folder]);
    assert!(
        message.contains("expected at most 4294967296 bytes, found 1099511627776"),
        "{message}"
    );
}

#[test]
fn what_is_no_dataset_is_named_by_every_command_that_wants_one() {
    let site = DaemonSite::new();
    dataset(&site, MANIFEST, run().as_bytes());
    let at = |name: &str| site.path().join(name).display().to_string();
    for verb in ["identify", "explain", "replay"] {
        for (name, found) in [("1.csv", "not a TOML file"), ("train.toml", "a train's file")] {
            let expected = "expected a dataset's folder or its dataset.toml";
            let message = refusal(&site, &[verb, &at(name)]);
            assert_eq!(message, format!("dynocar: {}: {found}; {expected}\n", at(name)));
        }
        let message = refusal(&site, &[verb, &at("no")]);
        assert_eq!(message, format!("dynocar: {}: no such file or folder\n", at("no")));
    }
}

#[test]
fn a_recording_that_lacks_what_makes_a_run_is_refused_by_every_command() {
    let site = DaemonSite::new();
    let one_column_is = |column: usize, value: &str| {
        let mut text = String::new();
        for (row, line) in run().lines().enumerate() {
            let mut cells: Vec<&str> = line.split(',').collect();
            if row > 0 {
                cells[column] = value;
            }
            writeln!(text, "{}", cells.join(",")).unwrap();
        }
        text
    };
    let cases = [
        (one_column_is(1, "NaN"), "column 'v': expected values of speed, found none in 600 rows"),
        (one_column_is(1, "1e308"), "column 'v': expected values of speed, found none in 600 rows"),
        (one_column_is(0, ""), "column 't': expected values of time, found none in 600 rows"),
        (one_column_is(0, "7"), "column 't': expected times that grow, found 7 s in all 600 rows"),
        (String::new(), "expected a header line with the columns' names, found an empty file"),
        ("t,v,F,i\n".into(), "expected rows of values below the header, found none"),
        (
            run().replace(',', ";"),
            "expected columns separated by ',', found ';' in the header: set delimiter = \";\" \
             in [dataset]",
        ),
    ];
    for (text, words) in cases {
        let folder = dataset(&site, MANIFEST, text.as_bytes());
        for verb in ["check", "identify", "explain"] {
            let message = refusal(&site, &[verb, &folder]);
            assert!(message.ends_with(&format!("{words}\n")), "{verb}: {message}");
        }
    }
    let folder = dataset(&site, MANIFEST, one_column_is(2, "NaN").as_bytes());
    let message = refusal(&site, &["explain", &folder]);
    let file = site.path().join("1.csv");
    let words = "expected samples with traction and brake force, got none among 600 samples";
    assert_eq!(message, format!("dynocar: {}: {words}\n", file.display()));
}

#[test]
fn common_spellings_of_one_recording_give_one_answer() {
    let site = DaemonSite::new();
    let plain = run();
    let quoted: String = plain
        .lines()
        .enumerate()
        .map(|(row, line)| match row {
            0 => format!("{line}\n"),
            _ => {
                line.split(',')
                    .map(|it| format!("\"{}\"", it.replace('.', ",")))
                    .collect::<Vec<_>>()
                    .join(",")
                    + "\n"
            }
        })
        .collect();
    let commas = MANIFEST.replacen("name = \"x\"", "name = \"x\"\ndecimal = \",\"", 1);
    let cases = [
        (MANIFEST, plain.clone()),
        (MANIFEST, format!("\u{feff}{plain}")),
        (MANIFEST, plain.replace('\n', "\r\n")),
        (&commas, quoted),
    ];
    let answers = cases.map(|(manifest, text)| {
        let folder = dataset(&site, manifest, text.as_bytes());
        let output = finished(&["explain", &folder, "--json", "-"].map(OsStr::new));
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    });
    assert!(answers.iter().all(|answer| *answer == answers[0]));
}

#[test]
fn a_lone_run_is_reported_as_one_of_which_nothing_was_scored_everywhere() {
    let site = DaemonSite::new();
    let folder = dataset(&site, MANIFEST, run().as_bytes());
    let (json, page) = (site.path().join("a.json"), site.path().join("a.html"));
    let arguments =
        ["explain", &folder, "--json", json.to_str().unwrap(), "--report", page.to_str().unwrap()];
    let output = finished(&arguments.map(OsStr::new));
    let printed = String::from_utf8(output.stdout).unwrap();
    let answer: Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
    assert_eq!(answer["scored_runs"], 0);
    let line = answer["unscored"].as_str().unwrap();
    let words = "No run is held out (role = \"holdout\"), so that nothing was scored: the open-loop \
                 error on the fit runs, ";
    assert!(line.starts_with(words), "{line}");
    assert!(line.ends_with("is of runs that the model was fitted to, and says nothing of others."));
    let on_one_line = printed.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(on_one_line.contains(line), "{printed}");
    let page = std::fs::read_to_string(page).unwrap();
    assert!(page.contains(&line.replace('"', "&quot;")), "the page says it, too");
}

#[test]
fn a_dataset_of_holdout_runs_only_is_called_so() {
    let site = DaemonSite::new();
    let folder = dataset(&site, &format!("{MANIFEST}role = \"holdout\"\n"), run().as_bytes());
    let output = finished(&["explain", &folder].map(OsStr::new));
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(printed.starts_with("No run is there to fit: all 1 are held out.\n"), "{printed}");
}

#[test]
fn paths_that_are_no_text_work_for_input_and_results() {
    let site = DaemonSite::new();
    let folder = site.path().join(OsStr::from_bytes(b"gr\xf6\xdfe"));
    std::fs::create_dir(&folder).unwrap();
    for (name, text) in [("dataset.toml", MANIFEST), ("train.toml", TRAIN), ("1.csv", &run())] {
        std::fs::write(folder.join(name), text).unwrap();
    }
    let result = folder.join(OsStr::from_bytes(b"\xff.json"));
    for verb in ["check", "explain"] {
        let arguments = [verb.as_ref(), folder.as_os_str(), "--json".as_ref(), result.as_os_str()];
        let output = finished(&arguments);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let answer: Value = serde_json::from_slice(&std::fs::read(&result).unwrap()).unwrap();
        assert!(answer.is_object());
    }
}

#[test]
fn rights_that_are_lacking_are_reported_in_words() {
    let site = DaemonSite::new();
    let folder = dataset(&site, MANIFEST, run().as_bytes());
    let without_privileges = |arguments: &[&str]| {
        let mut command = Command::new(DYNOCAR);
        if rustix::process::geteuid().is_root() {
            // Root may read and write everything by these two alone.
            command = Command::new("setpriv");
            command.args(["--bounding-set=-dac_override,-dac_read_search", DYNOCAR]);
        }
        let output = command.args(arguments).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let set = |path: &Path, mode: u32| {
        let mode = std::os::unix::fs::PermissionsExt::from_mode(mode);
        std::fs::set_permissions(path, mode).unwrap();
    };
    set(site.path(), 0o555);
    let json = site.path().join("a.json");
    let (status, message) =
        without_privileges(&["check", &folder, "--json", json.to_str().unwrap()]);
    let words = format!("dynocar: {}: cannot be written: Permission denied", json.display());
    assert!(message.starts_with(&words), "{message}");
    assert_eq!(status, Some(1));
    set(&site.path().join("1.csv"), 0o000);
    for verb in ["check", "identify", "explain"] {
        let (status, message) = without_privileges(&[verb, &folder]);
        assert!(message.ends_with("1.csv: cannot be read: permission denied\n"), "{message}");
        assert_eq!(status, Some(2));
    }
    set(site.path(), 0o755);
}

#[test]
fn holdout_runs_of_one_name_in_different_folders_each_keep_their_predictions() {
    let site = DaemonSite::new();
    let holdout = "[[runs]]\nfile = \"a/1.csv\"\nrole = \"holdout\"\n\
                   [[runs]]\nfile = \"b/1.csv\"\nrole = \"holdout\"\n";
    let folder = dataset(&site, &format!("{MANIFEST}{holdout}"), run().as_bytes());
    for name in ["a", "b"] {
        std::fs::create_dir(site.path().join(name)).unwrap();
        std::fs::write(site.path().join(name).join("1.csv"), run()).unwrap();
    }
    let predictions = site.path().join("predictions");
    let arguments = ["explain", &folder, "--predictions", predictions.to_str().unwrap()];
    assert_eq!(finished(&arguments.map(OsStr::new)).status.code(), Some(0));
    for name in ["a_1.csv", "b_1.csv"] {
        let text = std::fs::read_to_string(predictions.join(name)).unwrap();
        assert!(text.starts_with("time_s,speed_mps\n") && text.lines().count() == 601, "{name}");
    }
}
