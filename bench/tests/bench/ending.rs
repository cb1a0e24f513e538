//! Ctrl-C: what is done is given, and nothing is left.

use std::fs;

use dynocar_tests::process::DaemonSite;
use rustix::process::Signal;
use serde_json::Value;

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
