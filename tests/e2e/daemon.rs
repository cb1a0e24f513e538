//! The daemon as a user runs it: start, stop, refusals.

use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::{ParameterSnapshot, SampleField, TrainId, TrainSample};
use dynocar_tests::process::{DaemonSite, Process, await_true};
use dynocar_transport::{Announcement, Role};
use rustix::process::Signal;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const ECHO: &str = "[[pipelines]]\nkind = \"echo\"\n";

fn daemon(site: &DaemonSite, daemon_lines: &str, pipelines: &str) -> Process {
    let config = site.write_config(1, daemon_lines, pipelines);
    site.start(DYNOCAR, &["run", "--config", config.to_str().expect("a UTF-8 path")])
}

#[test]
fn sigterm_and_sigint_stop_the_daemon_cleanly() {
    for signal in [Signal::TERM, Signal::INT] {
        let site = DaemonSite::new();
        let mut daemon = daemon(&site, "", ECHO);
        daemon.await_error("serving");
        daemon.signal(signal);
        assert_eq!(daemon.wait().code(), Some(0), "{}", daemon.errors());
        assert!(daemon.errors().contains("stopped"));
    }
}

#[test]
fn every_idle_strategy_serves() {
    for idle in ["busy", "adaptive", "event"] {
        let site = DaemonSite::new();
        let daemon = daemon(&site, &format!("idle = \"{idle}\""), ECHO);
        daemon.await_error("serving");
        let host = site.host();
        let mut publisher = SamplePublisher::open(&host, TrainId(1)).unwrap();
        let mut reader = SnapshotReader::open(&host, TrainId(1)).unwrap();
        for sent in 1..=50 {
            let mut sample = TrainSample::empty(TrainId(1)).with(SampleField::Speed, 20.0);
            sample.time_ns = sent * 10_000_000;
            publisher.publish(&mut sample).unwrap();
            await_true(
                || {
                    reader.poll();
                    let mut readings = reader.readings(0);
                    readings.any(|reading| reading.snapshot.samples_used == sent as u64)
                },
                || format!("sample {sent} under {idle}: {}", daemon.errors()),
            );
        }
    }
}

#[test]
fn a_sample_published_as_soon_as_the_first_snapshot_is_there_is_not_lost() {
    const PIPELINES: usize = 32;
    let site = DaemonSite::new();
    let host = site.host();
    let mut publisher = SamplePublisher::open(&host, TrainId(1)).unwrap();
    let mut reader = SnapshotReader::open(&host, TrainId(1)).unwrap();
    let echo = |k| format!("{ECHO}name = \"{k}\"\nthread = \"all\"\n");
    let pipelines: String = (0..PIPELINES).map(echo).collect();
    let daemon = daemon(&site, "", &format!("[[threads]]\nname = \"all\"\n{pipelines}"));
    await_true(
        || {
            reader.poll();
            reader.readings(0).count() > 0
        },
        || daemon.errors(),
    );
    let mut sample = TrainSample::empty(TrainId(1)).with(SampleField::Speed, 20.0);
    sample.time_ns = 1;
    publisher.publish(&mut sample).unwrap();
    await_true(
        || {
            reader.poll();
            let taken = |it: &ParameterSnapshot| it.samples_used == 1;
            reader.readings(0).filter(|it| taken(it.snapshot)).count() == PIPELINES
        },
        || format!("all pipelines to take the sample: {}", daemon.errors()),
    );
}

#[test]
fn a_second_daemon_on_a_train_refuses_in_words() {
    let site = DaemonSite::new();
    let first = daemon(&site, "", ECHO);
    first.await_error("serving");
    let mut second = daemon(&site, "", ECHO);
    assert_eq!(second.wait().code(), Some(1));
    let message = second.errors();
    assert!(message.contains("train 1: already has a daemon: daemon"), "{message}");
}

#[test]
fn a_controller_of_another_schema_is_named_in_the_log() {
    let site = DaemonSite::new();
    let ours = Announcement::of_this_process(Role::Controller);
    let path = site.host().trains_directory().join("1.controller");
    let text = format!(
        "process_id=4242\nversion=9.0.0\nschema=9\ntransport={}\nsample_layout=1\n\
         snapshot_layout=2\n",
        ours.transport
    );
    std::fs::write(&path, text).unwrap();
    let held = std::fs::File::open(&path).unwrap();
    held.lock().unwrap();
    let daemon = daemon(&site, "", ECHO);
    daemon.await_error("the controller is incompatible");
    daemon.await_error("schema 9");
}

#[test]
fn a_wrong_configuration_is_refused_with_key_value_and_range() {
    let cases = [
        ("spin_us = 2000000", ECHO, "daemon.spin_us = 2000000: expected a whole number"),
        ("spinn_us = 2", ECHO, "unknown key 'spinn_us'; did you mean 'spin_us'?"),
        ("idle = \"lazy\"", ECHO, "unknown value 'lazy' (choices: 'busy', "),
        (
            "",
            "[[pipelines]]\nkind = \"kalmann\"\n",
            "pipelines.kalmann.kind = kalmann: expected one",
        ),
        (
            "",
            "[[pipelines]]\nkind = \"echo\"\nthread = \"fast\"\n",
            "the name of a [[threads]] table",
        ),
        (
            "",
            "[[pipelines]]\nkind = \"echo\"\ntrains = [7]\n",
            "expected the id of a [[trains]] table: 1",
        ),
        ("", "[[pipelines]]\nkind = \"echo\"\nsettings = { gain = 1 }\n", "unknown key 'gain'"),
        ("", "", "pipelines = 0: expected 1 to 32"),
        (
            "",
            "[[threads]]\nname = \"t\"\ncore = 4096\n[[pipelines]]\nkind = \"echo\"\nthread = \"t\"\n",
            "threads.core = 4096: expected a core of this machine",
        ),
    ];
    for (daemon_lines, pipelines, expected) in cases {
        let site = DaemonSite::new();
        let mut daemon = daemon(&site, daemon_lines, pipelines);
        assert_eq!(daemon.wait().code(), Some(2), "{}", daemon.errors());
        let message = daemon.errors();
        assert!(message.contains(expected), "expected {expected:?} in:\n{message}");
        assert!(message.contains("daemon.toml"), "the file is named:\n{message}");
    }
}

#[test]
fn several_trains_on_one_thread_are_kept_apart() {
    const TRAINS: u64 = 5;
    let site = DaemonSite::new();
    let pipelines = "[[threads]]\nname = \"all\"\n\
                     [[pipelines]]\nkind = \"echo\"\nname = \"one\"\nthread = \"all\"\n\
                     [[pipelines]]\nkind = \"echo\"\nname = \"two\"\nthread = \"all\"\ntrains = [2, 4]\n";
    let config = site.write_config(TRAINS, "", pipelines);
    let daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().expect("UTF-8")]);
    daemon.await_error("serving");
    let host = site.host();
    for id in 1..=TRAINS {
        let train = TrainId(id);
        let mut publisher = SamplePublisher::open(&host, train).unwrap();
        let mut reader = SnapshotReader::open(&host, train).unwrap();
        for _ in 0..10 * id {
            let mut sample = TrainSample::empty(train).with(SampleField::Speed, 10.0 + id as f64);
            sample.time_ns = publisher.published() as i64 * 100_000_000;
            publisher.publish(&mut sample).unwrap();
        }
        let expected = if id % 2 == 0 { 2 } else { 1 };
        await_true(
            || {
                reader.poll();
                let used = |count: u64| {
                    reader.readings(0).filter(move |it| it.snapshot.samples_used == count).count()
                };
                used(10 * id) == expected
            },
            || format!("train {id}: {}", daemon.errors()),
        );
        assert!(reader.readings(0).all(|reading| reading.snapshot.train_id == id));
    }
}
