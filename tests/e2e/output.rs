//! Results that cannot be written: closed pipes, full disks, interrupted writers; and the right stream for each output.

use std::fs::OpenOptions;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use dynocar_tests::process::{DaemonSite, await_true};
use rustix::process::Signal;
use serde_json::Value;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const WATCH: &str = env!("CARGO_BIN_EXE_dynocar-watch-under-test");
const SOAK: &str = env!("CARGO_BIN_EXE_dynocar-soak");
const DEMO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/demo");

/// Commands with a result on standard output, that end by themselves.
const COMMANDS: [(&str, &[&str]); 16] = [
    (DYNOCAR, &["--help"]),
    (DYNOCAR, &["explain", "--help"]),
    (DYNOCAR, &["--version"]),
    (DYNOCAR, &["check", DEMO]),
    (DYNOCAR, &["check", DEMO, "--json", "-"]),
    (DYNOCAR, &["identify", DEMO, "--estimator", "rls"]),
    (DYNOCAR, &["identify", DEMO, "--estimator", "rls", "--json", "-"]),
    (DYNOCAR, &["explain", DEMO]),
    (DYNOCAR, &["explain", DEMO, "--json", "-"]),
    (DYNOCAR, &["stops", DEMO, "--applied", "0.3"]),
    (DYNOCAR, &["stops", DEMO, "--applied", "0.3", "--json", "-"]),
    (DYNOCAR, &["init", "--help"]),
    (DYNOCAR, &["completions", "bash"]),
    (WATCH, &["--help"]),
    (SOAK, &["--help"]),
    (SOAK, &["fuzz", "--rounds", "1"]),
];

fn command(site: &DaemonSite, (program, arguments): (&str, &[&str])) -> Command {
    let mut command = site.command(program, arguments);
    command.stdin(Stdio::null());
    command
}

/// A pipe that nobody reads any more.
fn closed_pipe() -> Stdio {
    let (_, writer) = std::io::pipe().unwrap();
    writer.into()
}

fn full_disk() -> Stdio {
    OpenOptions::new().write(true).open("/dev/full").unwrap().into()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_closed_pipe_ends_every_command_quietly() {
    let site = DaemonSite::new();
    for it in COMMANDS {
        let output = command(&site, it).stdout(closed_pipe()).output().unwrap();
        assert_eq!((output.status.code(), said(&output).as_str()), (Some(0), ""), "{it:?}");
        let status = command(&site, it).stdout(Stdio::null()).stderr(closed_pipe()).status();
        assert_eq!(status.unwrap().code(), Some(0), "{it:?}, standard error");
    }
}

#[test]
fn a_full_disk_under_standard_output_is_reported_by_every_command() {
    let site = DaemonSite::new();
    for it in COMMANDS {
        let output = command(&site, it).stdout(full_disk()).output().unwrap();
        let words = "standard output: cannot be written: No space left on device";
        assert!(said(&output).contains(words), "{it:?}: {}", said(&output));
        assert_eq!(output.status.code(), Some(1), "{it:?}");
        let status = command(&site, it).stdout(Stdio::null()).stderr(full_disk()).status();
        assert_eq!(status.unwrap().code(), Some(0), "{it:?}, standard error");
    }
}

#[test]
fn what_people_read_on_standard_error_survives_its_loss() {
    let replay = (DYNOCAR, &["replay", DEMO, "--run", "1", "--rate", "1000"][..]);
    let wrong = (DYNOCAR, &["check", "/nowhere"][..]);
    for it in [replay, wrong] {
        // Side by side, for a replay waits for a daemon.
        let start = |stderr: Stdio| {
            let site = DaemonSite::new();
            let child = command(&site, it).stdout(Stdio::null()).stderr(stderr).spawn();
            (child.unwrap(), site)
        };
        let started = [Stdio::null(), closed_pipe(), full_disk()].map(start);
        let [kept, lost @ ..] = started.map(|(mut child, _site)| child.wait().unwrap());
        assert_eq!(lost, [kept; 2], "{it:?}");
    }
    let site = DaemonSite::new();
    let stock = concat!(env!("CARGO_MANIFEST_DIR"), "/corpus/import/rolling_stock.yaml");
    for (number, lost) in [closed_pipe(), full_disk()].into_iter().enumerate() {
        let out = format!("imported{number}");
        let import = (DYNOCAR, &["import", stock, "--train", "ore", "--out", &out][..]);
        let mut import = command(&site, import);
        let status = import.current_dir(site.path()).stdout(Stdio::null()).stderr(lost).status();
        assert_eq!(status.unwrap().code(), Some(0), "import {number}");
        assert!(site.path().join(out).join("train.toml").is_file());
    }
    for (number, lost) in [closed_pipe(), full_disk()].into_iter().enumerate() {
        let out = format!("dynocar{number}.fmu");
        let mut fmu = command(&site, (DYNOCAR, &["fmu", "-o", &out][..]));
        let status = fmu.current_dir(site.path()).stdout(Stdio::null()).stderr(lost).status();
        assert_eq!(status.unwrap().code(), Some(0), "fmu {number}");
        assert!(site.path().join(out).is_file());
    }
    let demo = (DYNOCAR, &["demo", "--rate", "1000"][..]);
    let output = command(&site, demo).stdout(full_disk()).output().unwrap();
    assert!(said(&output).contains("standard output: cannot be written"), "{}", said(&output));
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn a_daemon_whose_log_cannot_be_written_serves_and_health_keeps_its_verdict() {
    let site = DaemonSite::new();
    let config = site.write_config(1, "", "[[pipelines]]\nkind = \"echo\"\n");
    let config = config.to_str().unwrap();
    let health = (DYNOCAR, &["health", "--config", config][..]);
    let verdict = |stdout: Stdio, stderr: Stdio| {
        command(&site, health).stdout(stdout).stderr(stderr).status().unwrap().code()
    };
    for lost in [closed_pipe as fn() -> Stdio, full_disk] {
        assert_eq!(verdict(lost(), Stdio::null()), Some(6), "no daemon");
        let mut daemon = command(&site, (DYNOCAR, &["run", "--config", config]));
        let mut daemon = daemon.stdout(Stdio::null()).stderr(lost()).spawn().unwrap();
        await_true(
            || verdict(Stdio::null(), Stdio::null()) == Some(0),
            || "a daemon that is well".into(),
        );
        assert_eq!(verdict(lost(), Stdio::null()), Some(0), "a daemon that is well");
        assert_eq!(verdict(lost(), lost()), Some(0), "nobody to report to");
        assert!(daemon.try_wait().unwrap().is_none(), "the daemon goes on");
        let pid = rustix::process::Pid::from_raw(daemon.id() as i32).unwrap();
        rustix::process::kill_process(pid, Signal::TERM).unwrap();
        assert_eq!(daemon.wait().unwrap().code(), Some(0));
    }
}

#[test]
fn a_full_disk_under_a_file_is_reported_with_its_name() {
    let site = DaemonSite::new();
    let full = |name: &str| {
        let path = site.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::os::unix::fs::symlink("/dev/full", &path).unwrap();
        path.display().to_string()
    };
    let at = |name: &str| site.path().join(name).display().to_string();
    let cases = [
        ("check", "--json", "/dev/full".to_string(), "/dev/full".to_string()),
        ("explain", "--json", full("a.json"), at("a.json")),
        ("explain", "--report", full("a.html"), at("a.html")),
        ("explain", "--plots", at("plots"), full("plots/residual_by_speed.svg")),
        ("explain", "--grown", at("grown"), full("grown/train.toml")),
    ];
    for (verb, option, value, named) in cases {
        let output = command(&site, (DYNOCAR, &[verb, DEMO, option, &value])).output().unwrap();
        let words = format!("dynocar: {named}: cannot be written: No space left on device");
        assert!(said(&output).contains(&words), "{option}: {}", said(&output));
        assert_eq!(output.status.code(), Some(1), "{option}");
    }
}

#[test]
fn a_file_is_whole_or_as_it_was_when_a_write_fails_or_is_interrupted() {
    let site = DaemonSite::new();
    let folder = site.path().join("results");
    std::fs::create_dir(&folder).unwrap();
    let file = folder.join("a.html");
    std::fs::write(&file, "as it was").unwrap();
    let explain = format!("exec {DYNOCAR} explain {DEMO} --report {}", file.display());
    // Files may grow to some kilobytes: the page breaks off within.
    let limited = format!("trap '' XFSZ; ulimit -f 4; {explain}");
    let output = command(&site, ("sh", &["-c", &limited])).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(
        said(&output).contains("a.html: cannot be written: File too large"),
        "{}",
        said(&output)
    );
    let names = || std::fs::read_dir(&folder).unwrap().count();
    assert_eq!((std::fs::read_to_string(&file).unwrap().as_str(), names()), ("as it was", 1));
    for pause_ms in [0, 30, 300] {
        let mut process = site.start("sh", &["-c", &explain]);
        std::thread::sleep(Duration::from_millis(pause_ms));
        if process.try_wait().is_none() {
            process.signal(Signal::INT);
        }
        process.wait();
        let text = std::fs::read_to_string(&file).unwrap();
        let is_whole = text.starts_with("<!DOCTYPE html>") && text.ends_with("</html>\n");
        assert!(text == "as it was" || is_whole, "{text}");
    }
}

#[test]
fn names_of_results_that_would_cost_data_are_refused_before_the_work() {
    let site = DaemonSite::new();
    for entry in std::fs::read_dir(DEMO).unwrap().flatten().filter(|it| it.path().is_file()) {
        std::fs::copy(entry.path(), site.path().join(entry.file_name())).unwrap();
    }
    let run = site.write("1.csv", "t,v\n");
    let at = |name: &str| site.path().join(name).display().to_string();
    let (manifest, folder, run) = (at("dataset.toml"), at(""), run.display().to_string());
    let new = at("new.html");
    let wrong: [&[&str]; 3] = [
        &["explain", DEMO, "--report", &folder],
        &["explain", DEMO, "--plots", &run],
        &["explain", DEMO, "--report", "/no/such/folder/a.html"],
    ];
    for arguments in wrong {
        let output = command(&site, (DYNOCAR, arguments)).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {}", said(&output));
        let words = format!("dynocar: {}: cannot be written: ", arguments[3]);
        assert!(said(&output).starts_with(&words), "{arguments:?}: {}", said(&output));
    }
    let cases: [&[&str]; 7] = [
        &["explain", DEMO, "--report", &manifest],
        &["explain", DEMO, "--json", &manifest],
        &["explain", "/nowhere", "--json", &manifest],
        &["identify", DEMO, "--json", &run],
        &["check", DEMO, "--json", &manifest],
        &["explain", DEMO, "--grown", &folder],
        &["explain", DEMO, "--report", &new, "--json", &new],
    ];
    let before = std::fs::read_to_string(&manifest).unwrap();
    for arguments in cases {
        let output = command(&site, (DYNOCAR, arguments)).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", said(&output));
        assert_eq!(output.stdout, b"", "{arguments:?}");
    }
    assert_eq!(std::fs::read_to_string(&manifest).unwrap(), before);
    assert_eq!(std::fs::read_to_string(&run).unwrap(), "t,v\n");
    assert!(!Path::new(&new).exists());
}

#[test]
fn people_get_results_unless_standard_output_is_for_machines() {
    let site = DaemonSite::new();
    let file = site.path().join("a.json").display().to_string();
    let cases: [(&[&str], &str); 3] = [
        (&["check", DEMO], "dataset  "),
        (&["identify", DEMO, "--estimator", "rls"], "± is the half width"),
        (&["explain", DEMO], "a = "),
    ];
    for (arguments, words) in cases {
        let with = |json: &str| {
            let all = [arguments, &["--json", json]].concat();
            String::from_utf8(command(&site, (DYNOCAR, &all)).output().unwrap().stdout).unwrap()
        };
        assert!(with(&file).contains(words), "{arguments:?}");
        let of_file: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
        let of_output: Value = serde_json::from_str(&with("-")).unwrap();
        assert!(of_file == of_output && of_file.is_object(), "{arguments:?}");
    }
}

#[test]
fn machines_get_errors_as_json_with_the_same_exit_status() {
    let site = DaemonSite::new();
    let train = site.write("train.toml", "[train]\nmass_t = -1\nlength_m = 50\nrotating_mass_factor = 0.05\n[resistance]\na = 1\nb = 0\nc = 0\n").display().to_string();
    let manifest = "[dataset]\nname = \"x\"\n[train]\nfile = \"train.toml\"\n[columns]\n\
                    time = { column = \"t\", unit = \"s\" }\n\
                    speed = { column = \"v\", unit = \"m/s\" }\n[[runs]]\nfile = \"1.csv\"\n";
    let manifest = site.write("dataset.toml", manifest).display().to_string();
    let file = site.path().join("a.json").display().to_string();
    let cases: [(&[&str], Option<&str>, Option<u64>); 7] = [
        (&["explain", DEMO, "--report", &manifest], None, None),
        (&["check", &train], Some(&train), Some(2)),
        (&["identify", &manifest], Some(&train), Some(2)),
        (&["explain", &manifest], Some(&train), Some(2)),
        (&["explain", "/nowhere"], Some("/nowhere"), None),
        (&["identify", DEMO, "--estimator", "x"], None, None),
        (&["explain", DEMO, "--wrong"], None, None),
    ];
    for (arguments, named, line) in cases {
        let with = |json: &[&str]| {
            let all = [arguments, json].concat();
            command(&site, (DYNOCAR, &all)).output().unwrap()
        };
        let (plain, output) = (with(&[]), with(&["--json", "-"]));
        assert_eq!((plain.status.code(), output.status), (Some(2), plain.status));
        assert_eq!(said(&plain), said(&output));
        let answer: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        let error = &answer["error"];
        let message = error["message"].as_str().unwrap();
        assert!(said(&plain).contains(message), "{message:?}: {}", said(&plain));
        assert_eq!((error["file"].as_str(), error["line"].as_u64()), (named, line), "{answer}");
        assert_eq!(error["exit_status"], 2);
        if !arguments.contains(&"--wrong") {
            with(&["--json", &file]);
            let in_file: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
            assert_eq!(in_file, answer, "an older answer does not stay");
        }
    }
}
