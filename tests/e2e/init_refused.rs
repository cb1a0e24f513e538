//! Refusals of `dynocar init`, which leave no trace.

use std::fs::{create_dir_all, read_to_string, write};
use std::process::{Command, Stdio};

use dynocar_tests::process::DaemonSite;

use crate::commands::{DYNOCAR, done, dynocar, run, said};

/// Returns the standard error of a command that must end with status 2 and write nothing into the folder `new`.
fn refusal(site: &DaemonSite, arguments: &[&str]) -> String {
    let mut process = site.start(DYNOCAR, arguments);
    let status = process.wait();
    assert_eq!(status.code(), Some(2), "{arguments:?}: {}", process.errors());
    assert!(!site.path().join("new").exists(), "{arguments:?}");
    process.errors()
}

#[test]
fn nothing_that_is_there_is_overwritten() {
    for name in ["train.toml", "daemon.toml", "dataset.toml"] {
        let site = DaemonSite::new();
        create_dir_all(site.path().join("made")).unwrap();
        let there = site.write(&format!("made/{name}"), "mine");
        site.write("a.csv", &run("t,v [km/h],F [kN],x"));
        let output = dynocar(&site, &["init", "made", "--csv", "a.csv"]);
        assert_eq!(output.status.code(), Some(2), "{name}");
        let words = format!("dynocar: made/{name}: exists already, and is not overwritten");
        assert!(said(&output).starts_with(&words), "{}", said(&output));
        assert_eq!(read_to_string(&there).unwrap(), "mine");
        assert_eq!(std::fs::read_dir(site.path().join("made")).unwrap().count(), 1, "{name}");
    }
    let site = DaemonSite::new();
    done(&site, &["init", "made"]);
    assert_eq!(dynocar(&site, &["init", "made"]).status.code(), Some(2));
    site.write("file", "");
    let output = dynocar(&site, &["init", "file"]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(said(&output), "dynocar: file: cannot be written: it is no folder\n");
}

#[test]
fn what_is_no_recording_is_refused_in_words() {
    let site = DaemonSite::new();
    let pipe = site.path().join("pipe.csv");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    write(site.path().join("binary.csv"), [0u8; 5000]).unwrap();
    write(site.path().join("program.csv"), b"\x7fELF\x02\x01\x01\0\xff\xfe\n\xf0\x01").unwrap();
    let wide: Vec<u8> = "\u{feff}t,v\n0,1\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    write(site.path().join("cut.csv"), &wide[..wide.len() - 1]).unwrap();
    let cases = [
        ("missing.csv", None, "missing.csv: no such file"),
        ("pipe.csv", None, "pipe.csv: expected a file, found a pipe"),
        ("binary.csv", None, "binary.csv: expected text, found binary data"),
        ("program.csv", None, "program.csv:1: not UTF-8: save the file as UTF-8"),
        ("cut.csv", None, "cut.csv:2: not UTF-16LE: save the file as UTF-8"),
        ("", None, "expected a file, found a folder"),
        ("empty.csv", Some(""), "empty.csv: expected a header line"),
        ("blank.csv", Some("\n\n"), "blank.csv: expected a header line"),
        ("header.csv", Some("t,v\n"), "header.csv: expected rows of values below the header"),
        (
            "words.csv",
            Some("hello\nworld\n"),
            "words.csv:1: expected names of columns separated by",
        ),
        ("numbers.csv", Some("0,1\n1,2\n"), "numbers.csv:1: expected names of columns, found '0'"),
        (
            "few.csv",
            Some("t,v\n0,1,2\n1,2,3\n"),
            "few.csv:1: expected names of columns, found 2 cells",
        ),
        ("speedless.csv", Some("t,F\n0,1\n1,2\n"), "no column was recognised as speed"),
        ("dates.csv", Some("time,v\n2024-05-01,1\n2024-05-02,2\n"), "it holds text in line 2"),
        ("wide.csv", Some("t,v\n0,1\n1,2\n2,3,4\n"), "wide.csv:4: 3 cells, but the header has 2"),
    ];
    for (name, text, words) in cases {
        let path = match text {
            Some(text) => site.write(name, text),
            None => site.path().join(name),
        };
        let new = site.path().join("new");
        let arguments = ["init", new.to_str().unwrap(), "--csv", path.to_str().unwrap()];
        let message = refusal(&site, &arguments);
        assert!(message.contains(words), "{name}: {message}");
        assert_eq!(message.lines().count(), 1, "{name}: {message}");
    }
}

#[test]
fn a_wrong_command_line_is_refused_with_what_helps() {
    let site = DaemonSite::new();
    let csv = site.write("a.csv", &run("A,B,C,D")).display().to_string();
    let new = site.path().join("new").display().to_string();
    let with = |more: &[&str]| {
        let arguments = [&["init", &new, "--csv", &csv], more].concat();
        refusal(&site, &arguments)
    };
    let message = with(&[]);
    assert!(message.contains("say which it is: --column time=COLUMN:UNIT"), "{message}");
    assert!(message.contains("the columns: 'A', 'B', 'C', 'D'"), "{message}");
    let message = with(&["--column", "time=A", "--column", "speed=X"]);
    assert!(message.contains("no column 'X' for speed"), "{message}");
    let message = with(&["--column", "velocity=B"]);
    assert!(message.contains("'velocity' is no quantity; the quantities: time, "), "{message}");
    let message = with(&["--column", "time=A", "--column", "speed=B", "--mass-t", "-5"]);
    assert!(message.contains("train.mass_t = -5: expected a mass in t above 0"), "{message}");
    for (mark, expected) in [
        (["--delimiter", ";;"], "expected one ASCII character, as \",\" \";\" or \"\\t\""),
        (["--decimal", ";"], "expected \".\" or \",\""),
    ] {
        let message = with(&mark);
        assert!(message.contains(expected), "{message}");
    }
    let message = with(&["--delimiter", ".", "--decimal", "."]);
    assert!(message.contains("--decimal: expected another mark than the delimiter"), "{message}");
    let message = with(&["--delimiter", "|"]);
    assert!(message.contains("separated by '|', found only 'A"), "{message}");
    let message = with(&["--csv", &csv, "--column", "time=A", "--column", "speed=B"]);
    assert!(message.contains("expected every run once, found the file twice"), "{message}");
    let message = refusal(&site, &["init", &new, "--column", "time=A"]);
    assert!(message.contains("--column: expected recordings with it"), "{message}");
    let printed = done(
        &site,
        &["init", "made", "--csv", &csv, "--column", "time=A", "--column", "speed=B:km/h"],
    );
    assert!(printed.contains("given on the command line"), "{printed}");
    done(&site, &["check", "made"]);
}

#[test]
fn nobody_is_asked_and_a_closed_pipe_or_a_full_disk_changes_no_file() {
    let site = DaemonSite::new();
    site.write("a.csv", &run("t,v [km/h],F [kN],x"));
    let command = |folder: &str| {
        let mut command = Command::new(DYNOCAR);
        command.args(["init", folder, "--csv", "a.csv"]).current_dir(site.path());
        // Standard input is held open and silent: a program that read from it would wait for ever.
        command.stdin(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    let (_, writer) = std::io::pipe().unwrap();
    let mut child = command("closed").stdout(writer).spawn().unwrap();
    let silent = child.stdin.take();
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), said(&output).as_str()), (Some(0), ""));
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = command("full").stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(said(&output).contains("standard output: cannot be written"), "{}", said(&output));
    drop(silent);
    for folder in ["closed", "full"] {
        done(&site, &["check", folder]);
    }
}
