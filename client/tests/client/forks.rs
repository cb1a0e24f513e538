//! A controller that forks keeps its ends, in spite of anything that its child does; this process plays the daemon.

use std::collections::HashMap;
use std::process::Command;

use dynocar_client::ffi::Code;
use dynocar_client::{Peer, Role, SamplePublisher};

use crate::support::{Link, PlayedDaemon, Program, TRAIN, TestRoot, build_c, client_directory};

/// Runs a controller that forks; returns its lines by their first word, and the received samples.
fn drive(mode: &str, daemon: &PlayedDaemon) -> (HashMap<String, Vec<String>>, u64) {
    let folder = TestRoot::new();
    let program = folder.path().join("forked");
    let source = client_directory().join("tests/foreign/forked.c");
    build_c(&source, "gnu11", Link::Static, &program);
    let mut command = Command::new(program);
    command.arg(daemon.root()).args([&TRAIN.to_string(), mode]);
    let (mut lines, mut received) = (HashMap::<String, Vec<String>>::new(), 0);
    let controller = Program::start(&mut command);
    while let Some(line) = controller.next_line(|| {
        while let Some(sample) = daemon.next_sample() {
            received += 1;
            assert_eq!(sample.sequence, received, "{mode}");
            daemon.answer(&sample);
        }
    }) {
        let (word, rest) = line.split_once(' ').unwrap();
        lines.entry(word.to_owned()).or_default().push(rest.to_owned());
    }
    while daemon.next_sample().is_some() {
        received += 1;
    }
    if mode != "stay" {
        controller.finish();
    }
    (lines, received)
}

#[test]
fn a_child_that_ends_takes_nothing_of_its_parents_with_it() {
    let daemon = PlayedDaemon::start();
    let (lines, received) = drive("exit", &daemon);
    assert_eq!(received, 150);
    assert_eq!(
        (lines["refused"].join(" "), lines["closed"].join(" ")),
        ("0 0".into(), "0 0".into())
    );
}

#[test]
fn a_child_that_uses_and_closes_its_parents_ends_gets_codes_and_may_open_its_own() {
    let daemon = PlayedDaemon::start();
    let (lines, received) = drive("close", &daemon);
    assert_eq!(received, 150);
    let forked = (Code::ForkedProcess as i32).to_string();
    assert_eq!(lines["child"], [[forked.as_str(); 7].join(" ")]);
    assert_eq!(lines["own"], ["0 0 0"]);
    assert_eq!(
        (lines["refused"].join(" "), lines["closed"].join(" ")),
        ("0 0".into(), "0 0".into())
    );
}

#[test]
fn a_child_that_outlives_its_parent_does_not_hold_its_place() {
    let daemon = PlayedDaemon::start();
    let (lines, received) = drive("stay", &daemon);
    assert_eq!(received, 150);
    let child = lines["process"][0].clone();
    assert!(std::path::Path::new("/proc").join(&child).exists(), "the child lives on");
    let seen = Peer::look_up(daemon.host(), TRAIN, Role::Controller);
    let next = SamplePublisher::open(daemon.host(), TRAIN).map(drop);
    Command::new("kill").arg(child).status().unwrap();
    assert_eq!(seen.unwrap(), Peer::Absent);
    next.unwrap();
}
