//! `dynocar-bench` where its results cannot be given.

use std::process::{Command, Stdio};

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
