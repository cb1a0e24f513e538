//! The live view as a process next to a controller and a daemon, with viewers that come, stall and go.

mod support;
mod viewer;

use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

use dynocar_mcap::topic::{decode_sample, decode_snapshot, encode_sample};
use dynocar_shared::PipelineKind;

use crate::support_site::{Controller, TestSite};
use support::{Live, PROGRAM, published_sample};
use viewer::Viewer;

const SAMPLES: &str = "/train/1/samples";
const MASS: &str = "/train/1/0_mass_kalman";

#[test]
fn a_viewer_gets_what_was_published_bit_by_bit_in_order_and_at_wall_time() {
    let site = TestSite::new(&["mass_kalman"]);
    let live = Live::beside(&site, &["--samples-hz", "0"]);
    let controller = Controller::start(&site, 1);
    let mut viewer = Viewer::connect(live.port);
    viewer.subscribe(SAMPLES);
    let mut newest = 0;
    for _ in 0..200 {
        let seen = viewer.await_seen("a sample", |it| it.topic == SAMPLES);
        let sample = decode_sample(&seen.message).unwrap();
        let mut expected = Vec::new();
        encode_sample(&published_sample(&controller, sample.sequence), &mut expected);
        assert_eq!(seen.message, expected, "sample {}", sample.sequence);
        assert!(sample.sequence > newest);
        newest = sample.sequence;
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
        assert!(now.abs_diff(seen.log_time_ns) < 60_000_000_000, "{} at {now}", seen.log_time_ns);
    }
}

#[test]
fn of_five_hundred_samples_a_second_viewers_get_what_was_asked_for() {
    let site = TestSite::new(&["mass_kalman"]);
    let live = Live::beside(&site, &["--samples-hz", "20"]);
    let _controller = Controller::start(&site, 1);
    let mut viewer = Viewer::connect(live.port);
    viewer.subscribe(SAMPLES);
    let published: Vec<i64> = (0..40)
        .map(|_| viewer.await_seen("a sample", |it| it.topic == SAMPLES))
        .map(|seen| decode_sample(&seen.message).unwrap().published_ns)
        .collect();
    let span_s = 1e-9 * (published[39] - published[0]) as f64;
    assert!(span_s > 39.0 / 20.0 - 0.1, "40 samples in {span_s} s");
}

#[test]
fn channels_come_and_go_with_those_who_write_them() {
    let site = TestSite::new(&["mass_kalman"]);
    let live = Live::beside(&site, &[]);
    let mut viewer = Viewer::connect(live.port);
    viewer.await_topics(&["/events"]);
    for _ in 0..2 {
        let controller = Controller::start(&site, 1);
        viewer.await_topics(&["/events", SAMPLES]);
        drop(controller);
        viewer.await_topics(&["/events"]);
    }
}

#[test]
fn a_viewer_that_comes_late_gets_the_newest_snapshot() {
    let site = TestSite::new(&["mass_kalman"]);
    let live = Live::beside(&site, &["--train", "1"]);
    site.daemon();
    let mut first = Viewer::connect(live.port);
    let controller = Controller::start(&site, 1);
    first.subscribe(MASS);
    // The daemon's first one comes before any sample.
    let is_of_samples =
        |message: &[u8]| decode_snapshot(message).is_ok_and(|it| it.sample_sequence > 0);
    first.await_seen("a snapshot", |it| it.topic == MASS && is_of_samples(&it.message));
    drop(controller);
    first.await_topics(&["/events", MASS]);
    let mut late = Viewer::connect(live.port);
    late.subscribe(MASS);
    let seen = late.await_seen("the newest snapshot", |it| it.topic == MASS);
    let snapshot = decode_snapshot(&seen.message).unwrap();
    assert_eq!(snapshot.pipeline_kind(), Some(PipelineKind::MassKalman));
    assert!(snapshot.sample_sequence > 0);
}

#[test]
fn a_viewer_that_reads_nothing_is_reported_of_and_holds_nobody_up() {
    let site = TestSite::new(&["mass_kalman"]);
    let mut live = Live::beside(&site, &["--samples-hz", "0"]);
    let controller = Controller::start(&site, 40);
    let mut stalled = Viewer::connect(live.port);
    stalled.subscribe(SAMPLES);
    live.await_reported("does not keep up: its oldest messages are dropped");
    let mut viewer = Viewer::connect(live.port);
    viewer.subscribe(SAMPLES);
    let sequence = |viewer: &mut Viewer| {
        let seen = viewer.await_seen("a sample", |it| it.topic == SAMPLES);
        decode_sample(&seen.message).unwrap().sequence
    };
    let first = sequence(&mut viewer);
    while sequence(&mut viewer) < first + 2000 {}
    drop(controller);
    assert_eq!(live.interrupt(), Some(0), "{}", live.printed());
    assert!(live.printed().contains("a viewer has come: 2 now"), "{}", live.printed());
}

#[test]
fn a_viewer_of_the_older_protocol_is_refused_in_words() {
    let site = TestSite::new(&["mass_kalman"]);
    let live = Live::beside(&site, &[]);
    assert!(Viewer::offer(live.port, "foxglove.websocket.v1").is_none());
    live.await_reported("is refused: it does not offer foxglove.sdk.v1");
}

#[test]
fn a_taken_port_and_a_wrong_address_are_reported() {
    let site = TestSite::new(&["mass_kalman"]);
    let live = Live::beside(&site, &[]);
    let port = live.port.to_string();
    let run = |options: &[&str]| {
        let root = site.at("root");
        Command::new(PROGRAM).arg("--root").arg(root).args(options).output().unwrap()
    };
    let taken = run(&["--port", &port]);
    let printed = String::from_utf8_lossy(&taken.stderr);
    assert_eq!(taken.status.code(), Some(1), "{printed}");
    assert!(printed.contains(&format!("ws://127.0.0.1:{port}: cannot be served: ")), "{printed}");
    for options in [["--host", "here"], ["--port", "70000"], ["--samples-hz", "-1"]] {
        assert_eq!(run(&options).status.code(), Some(2), "{options:?}");
    }
}
