//! The measuring commands run and give sound results; their times decide nothing.

use std::process::{Command, Output};
use std::sync::atomic::{AtomicBool, Ordering};

use dynocar::runtime::system::pin_to_core;
use dynocar_tests::process::{DaemonSite, await_true};
use rustix::process::Signal;
use serde_json::Value;

fn bench(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dynocar-bench")).args(arguments).output().expect("the program")
}

fn answer(arguments: &[&str]) -> Value {
    let output = bench(arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {errors}", output.status);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {errors}"))
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"))
}

#[test]
fn latency_measures_floor_daemon_and_alternatives_in_one_run() {
    let folder = tempfile::tempdir().unwrap();
    let plot = folder.path().join("latency.svg");
    let answer = answer(&["latency", "--quick", "--json", "-", "--plot", plot.to_str().unwrap()]);
    let cases = answer["cases"].as_array().expect("cases");
    for (name, idle) in [
        ("floor", "busy"),
        ("floor", "event"),
        ("dynocar/regularised_rls", "busy"),
        ("dynocar/regularised_rls", "adaptive"),
        ("dynocar/regularised_rls", "event"),
        ("dynocar/all_fast", "busy"),
        ("alternative/unix_datagram", "busy"),
        ("alternative/unix_datagram", "event"),
        #[cfg(feature = "zeromq")]
        ("alternative/zeromq", "event"),
    ] {
        let case = cases
            .iter()
            .find(|case| case["case (idle)"] == format!("{name} ({idle})"))
            .unwrap_or_else(|| panic!("{name} ({idle}) in {answer}"));
        let quantiles =
            ["p50_ns", "p99_ns", "p99.9_ns", "p99.99_ns", "max_ns"].map(|key| number(case, key));
        assert!(quantiles[0] > 0.0 && quantiles.is_sorted(), "{case}");
        assert!(number(case, "count") > 0.0 && number(case, "p50/floor") > 0.0, "{case}");
        // A busy machine may answer late or, behind a full socket, never: but each is counted.
        let offered = |case: &Value| number(case, "count") + number(case, "unanswered");
        assert_eq!(offered(case), offered(&cases[0]), "{case}");
    }
    for key in ["poll_without_news_ns", "poll_with_news_ns", "publish_ns"] {
        assert!(number(&answer, key) > 0.0, "{key}");
    }
    let picture = std::fs::read_to_string(plot).unwrap();
    assert!(picture.starts_with("<svg") && picture.contains("dynocar/regularised_rls (busy)"));
}

#[test]
fn load_accounts_for_every_sample_of_every_pipeline() {
    let answer = answer(&[
        "load",
        "--quick",
        "--trains",
        "3",
        "--rate",
        "200",
        "--burst",
        "4",
        "--bad",
        "0.1",
        "--duration",
        "0.4",
        "--json",
        "-",
    ]);
    assert_eq!((number(&answer, "trains"), number(&answer, "rate_hz")), (3.0, 200.0));
    let pipelines = answer["pipelines"].as_array().expect("pipelines");
    assert!(pipelines.iter().any(|it| it["pipeline"] == "rls"));
    assert!(pipelines.iter().any(|it| it["pipeline"] == "adhesion_em"));
    for pipeline in pipelines {
        let [offered, used, rejected, lost] =
            ["offered", "used", "rejected", "lost"].map(|key| number(pipeline, key));
        assert!(offered > 0.0 && rejected > 0.0, "{pipeline}");
        assert_eq!(offered, used + rejected + lost, "{pipeline}");
        assert!(number(pipeline, "p50_ns") <= number(pipeline, "p99_ns"), "{pipeline}");
    }
    assert!(number(&answer, "cpu_percent") > 0.0 && number(&answer, "rss_bytes") > 1e6);
}

#[test]
fn an_argument_out_of_range_is_refused_with_its_range() {
    for (arguments, expected) in [
        (["load", "--bad", "1.5"], "--bad 1.5: expected a share from 0 to 1"),
        (["load", "--pipelines", "kalmann"], "kalmann: expected one of"),
        (["latency", "--rate", "0"], "--rate 0: expected"),
    ] {
        let output = bench(&arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(expected), "expected {expected:?} in {message:?}");
    }
}

/// Processes that the threads of a process started.
fn children_of(process: u32) -> Vec<String> {
    let tasks = std::fs::read_dir(format!("/proc/{process}/task")).into_iter().flatten().flatten();
    let children = tasks.map(|it| std::fs::read_to_string(it.path().join("children")));
    children
        .flatten()
        .flat_map(|it| it.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
        .collect()
}

#[test]
fn a_benchmark_that_is_ended_or_killed_takes_its_peers_along() {
    let is_running = |process: &String| {
        let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        stat.rsplit(") ").next().is_some_and(|it| !it.is_empty() && !it.starts_with('Z'))
    };
    for arguments in [
        &["load", "--quick", "--trains", "1", "--duration", "600"][..],
        &["latency", "--quick", "--seconds", "600", "--case", "floor"],
        &["latency", "--quick", "--seconds", "600", "--case", "dynocar"],
    ] {
        for signal in [Signal::TERM, Signal::INT, Signal::KILL] {
            let site = DaemonSite::new();
            // Files that a killed one leaves go with the site.
            let variables = [("TMPDIR", site.path().to_str().unwrap())];
            let program = env!("CARGO_BIN_EXE_dynocar-bench");
            let mut bench = site.start_with(program, arguments, &variables);
            let mut children = Vec::new();
            await_true(
                || {
                    children = children_of(bench.id());
                    !children.is_empty()
                },
                || format!("a peer of {arguments:?}: {}", bench.errors()),
            );
            bench.end(signal);
            await_true(|| !children.iter().any(is_running), || format!("the end of {children:?}"));
        }
    }
}

#[test]
fn a_core_that_others_use_is_named_before_a_measurement() {
    let is_over = AtomicBool::new(false);
    let output = std::thread::scope(|scope| {
        scope.spawn(|| {
            pin_to_core(0).unwrap();
            while !is_over.load(Ordering::Relaxed) {
                std::hint::spin_loop();
            }
        });
        let quick = ["load", "--quick", "--trains", "1", "--duration", "0.1"];
        let output = bench(&[&quick[..], &["--controller-core", "0"]].concat());
        is_over.store(true, Ordering::Relaxed);
        output
    });
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let words = said
        .lines()
        .find(|it| it.contains("core 0 is not its own"))
        .unwrap_or_else(|| panic!("{said}"));
    let percent = words.split("others take ").nth(1).and_then(|it| it.split(' ').next()).unwrap();
    assert!((15..=100).contains(&percent.parse::<u64>().unwrap()), "{words}");
    assert!(words.contains("end them, or name another core"), "{words}");
}
