//! The shipped parts work together: the daemon with `config/daemon.toml`, the demo's recording, and the examples in C,
//! C++ and Rust (`client/python/tests` tests that in Python).

use std::path::Path;
use std::process::Command;

use dynocar_shared::services::ROOT_VARIABLE;
use dynocar_tests::process::{DaemonSite, Process};

use crate::support::{self, Link, Program};

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const CONTROLLER: &str = env!("CARGO_BIN_EXE_dynocar-example-controller");
const STOPPING: &str = env!("CARGO_BIN_EXE_dynocar-example-stopping");

fn shipped(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    path.to_str().expect("a UTF-8 path").to_owned()
}

/// Returns the daemon with the shipped configuration, after it has seen the demo's recording.
fn daemon_that_has_learned(site: &DaemonSite) -> Process {
    let daemon = site.start(DYNOCAR, &["run", "--config", &shipped("config/daemon.toml")]);
    daemon.await_error("serving");
    let mut replay = site.start(DYNOCAR, &["replay", &shipped("config/demo"), "--rate", "1000"]);
    assert_eq!(replay.wait().code(), Some(0), "{}", replay.errors());
    daemon
}

/// The shipped example of a file, built as its language is.
fn examples(folder: &Path) -> Vec<(&'static str, Command)> {
    let source = support::client_directory().join("examples");
    let built = |name: &str| Command::new(folder.join(name));
    for (name, in_cpp) in [("controller", "controller.cpp"), ("stopping", "stopping.c")] {
        let file = source.join(format!("{name}.c"));
        support::build_c(&file, "c99", Link::Shared, &folder.join(format!("{name}-c")));
        support::build_cpp(&source.join(in_cpp), "c++17", &folder.join(format!("{name}-cpp")));
    }
    vec![
        ("C", built("controller-c")),
        ("C++", built("controller-cpp")),
        ("Rust", Command::new(CONTROLLER)),
        ("C, stopping", built("stopping-c")),
        ("C++, stopping", built("stopping-cpp")),
        ("Rust, stopping", Command::new(STOPPING)),
    ]
}

#[test]
fn every_shipped_example_comes_to_a_usable_resistance_from_the_shipped_daemon() {
    let site = DaemonSite::new();
    let daemon = daemon_that_has_learned(&site);
    let folder = tempfile::tempdir().expect("a folder for programs");
    for (name, mut command) in examples(folder.path()) {
        let program = Program::start(command.env(ROOT_VARIABLE, site.host().root()));
        let mut said = Vec::new();
        let is_answered = std::iter::from_fn(|| program.next_line(|| {})).any(|line| {
            let is_answer = line.contains("the daemon (usable)");
            said.push(line);
            is_answer
        });
        assert!(is_answered, "{name} said {said:#?}; the daemon said:\n{}", daemon.errors());
    }
}

/// Returns a configuration with the offers in its comments switched on.
fn with_its_offers(text: &str) -> String {
    let offered = |line: &str| {
        let rest = line.strip_prefix("# ")?;
        (rest.starts_with('[') || rest.contains(" = ")).then(|| rest.to_owned())
    };
    let lines = text.lines().map(|line| offered(line).unwrap_or(line.to_owned()) + "\n");
    lines.collect()
}

#[test]
fn telegraf_reads_the_metrics_where_the_shipped_configuration_puts_them() {
    let read = |path: &str| std::fs::read_to_string(shipped(path)).expect("a shipped file");
    let daemon = read("config/daemon.toml");
    let (_, after) = daemon.split_once("# [metrics]\n# listen = \"").expect("metrics are offered");
    let (address, _) = after.split_once('"').expect("an address");
    let text = read("config/live/telegraf.conf");
    let telegraf: toml::Table = text.parse().expect("TOML");
    let urls = telegraf["inputs"]["prometheus"][0]["urls"].as_array().expect("addresses");
    assert_eq!(urls[..], [format!("http://{address}/metrics").into()]);
    let topic = telegraf["outputs"]["mqtt"][0]["topic"].as_str().expect("a topic");
    assert!(topic.contains("{{ .Tag \"train\" }}"), "{topic}");
    // The broker stands there twice, with and without TLS.
    let offers = with_its_offers(&text).replacen("servers = [\"tcp:", "# servers = [\"tcp:", 1);
    let telegraf: toml::Table = offers.parse().expect("TOML with all that is offered");
    assert!(telegraf["outputs"]["mqtt"][0]["tls_ca"].is_str(), "{offers}");
    assert!(telegraf["processors"]["dedup"][0]["dedup_interval"].is_str(), "{offers}");
}

#[test]
fn the_driver_example_keeps_the_timetable_once_the_shipped_daemon_has_learned() {
    let site = DaemonSite::new();
    let daemon = site.start(DYNOCAR, &["run", "--config", &shipped("config/daemon.toml")]);
    daemon.await_error("serving");
    let folder = tempfile::tempdir().expect("a folder for programs");
    let program = folder.path().join("driver");
    let source = support::client_directory().join("examples/driver.c");
    support::build_c(&source, "c99", Link::Static, &program);
    let mut command = Command::new(program);
    command.env(ROOT_VARIABLE, site.host().root()).args(["1", "2"]);
    let said = support::must_succeed(&mut command);
    let late_s = |line: &str| -> f64 {
        let words = line.split_once(": ").expect("a leg").1;
        words.split(' ').next().expect("a time").parse().expect("a number")
    };
    assert!(late_s(said.lines().next().expect("a leg")) > 10.0, "{said}");
    let is_learned = |line: &str| line.contains("by the daemon") && late_s(line).abs() < 5.0;
    assert!(said.lines().any(is_learned), "{said}; the daemon said:\n{}", daemon.errors());
}
