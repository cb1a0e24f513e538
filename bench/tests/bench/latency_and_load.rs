//! The measuring commands run and give sound results; their times decide nothing.

use std::process::{Command, Output};

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
