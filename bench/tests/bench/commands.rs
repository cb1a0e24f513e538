//! The commands of `dynocar-bench`: documented measurements exist, Ctrl-C keeps the results so far, and a failure to
//! write output is reported.

use std::fs;
use std::process::{Command, Stdio};

use dynocar_tests::documents::{Shown, pages};
use dynocar_tests::process::DaemonSite;
use rustix::process::Signal;
use serde_json::Value;

#[test]
fn every_measurement_that_a_page_shows_is_one_that_the_bench_takes() {
    let shown: Vec<Shown> =
        pages().iter().flat_map(|page| page.commands("dynocar-bench")).collect();
    assert!(shown.len() > 20, "the commands are found: {}", shown.len());
    let refusals: Vec<String> =
        shown.iter().filter_map(|it| it.refusal(dynocar_bench::cli::command())).collect();
    assert!(refusals.is_empty(), "{}", refusals.join("\n"));
}

#[test]
fn an_ended_command_gives_what_it_has_and_leaves_no_folder() {
    // The words after which each has something.
    for (arguments, words, part) in [
        (&["explain", "--kind", "none", "--seeds", "100000", "--verbose"][..], "seed 2:", "kinds"),
        (&["load", "--quick", "--trains", "1", "--search"], "Hz: ", "search"),
        (&["latency", "--quick", "--case", "floor", "--rounds", "9999"], "round 3 of", "cases"),
    ] {
        let site = DaemonSite::new();
        let folder = site.path().join("left");
        fs::create_dir(&folder).unwrap();
        let json = site.path().join("result.json");
        let variables = [("TMPDIR", folder.to_str().unwrap())];
        let arguments = [arguments, &["--json", json.to_str().unwrap()]].concat();
        let program = env!("CARGO_BIN_EXE_dynocar-bench");
        let mut bench = site.start_with(program, &arguments, &variables);
        bench.await_error(words);
        let status = bench.end(Signal::INT);
        assert_eq!(status.code(), Some(130), "{arguments:?}: {}", bench.errors());
        let result: Value = serde_json::from_str(&fs::read_to_string(&json).unwrap()).unwrap();
        assert!(!result[part].is_null(), "{result}");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 0, "{arguments:?}");
    }
}

const CASES: [&[&str]; 2] = [&["--help"], &["estimators", "--quick", "--case", "regularised_rls"]];

fn bench(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dynocar-bench"));
    command.args(arguments).stdin(Stdio::null());
    command
}

#[test]
fn a_closed_pipe_ends_every_command_quietly() {
    for arguments in CASES {
        let (_, writer) = std::io::pipe().unwrap();
        let output = bench(arguments).stdout(writer).stderr(Stdio::piped()).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), &*said), (Some(0), ""), "{arguments:?}");
    }
}

#[test]
fn a_full_disk_is_reported_in_words() {
    for arguments in CASES {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = bench(arguments).stdout(full).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        let words = "dynocar-bench: standard output: cannot be written: No space left on device";
        assert!(said.starts_with(words), "{arguments:?}: {said}");
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
    }
}
