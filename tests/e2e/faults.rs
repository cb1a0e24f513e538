//! Faults of processes, memory and directories: no process hangs or is misled, and each fault is reported.

use std::process::Command;
use std::time::{Duration, Instant};

use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::{SampleField, TrainId, TrainSample};
use dynocar_tests::process::{DaemonSite, Process, await_true};
use dynocar_tests::soak::{Programs, faults};
use rustix::process::Signal;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const PEER: &str = env!("CARGO_BIN_EXE_dynocar-test-peer");
const ECHO: &str = "[[pipelines]]\nkind = \"echo\"\n";
const TRAIN: TrainId = TrainId(1);

fn daemon(site: &DaemonSite) -> Process {
    let config = site.write_config(1, "", ECHO);
    let daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().expect("UTF-8")]);
    daemon.await_error("serving");
    daemon
}

#[test]
fn random_kills_stops_and_restarts_mislead_nobody_and_leave_nothing() {
    let programs = Programs { dynocar: DYNOCAR.into(), peer: PEER.into() };
    println!("{:?}", faults::run(&programs, 15, 1));
}

#[test]
fn a_client_that_never_polls_and_a_controller_that_floods_hold_nobody_up() {
    const SAMPLES: u64 = 200_000;
    let site = DaemonSite::new();
    let daemon = daemon(&site);
    let _sleeping = site.start(PEER, &["client", "1", "3600000000"]);
    let host = site.host();
    let mut publisher = SamplePublisher::open(&host, TRAIN).unwrap();
    let mut reader = SnapshotReader::open(&host, TRAIN).unwrap();
    let mut longest = Duration::ZERO;
    for index in 0..SAMPLES {
        let mut sample = TrainSample::empty(TRAIN).with(SampleField::Speed, 20.0);
        sample.time_ns = index as i64 * 1_000_000;
        let start = Instant::now();
        publisher.publish(&mut sample).unwrap();
        longest = longest.max(start.elapsed());
    }
    println!("longest of {SAMPLES} publications: {longest:?}");
    await_true(
        || {
            reader.poll();
            reader.readings(0).any(|reading| reading.snapshot.sample_sequence == SAMPLES)
        },
        || format!("the newest sample: {}", daemon.errors()),
    );
    let it = *reader.readings(0).next().unwrap().snapshot;
    assert_eq!(it.samples_used + it.samples_rejected + it.samples_lost, SAMPLES, "{it:?}");
}

#[test]
fn a_stopped_daemon_holds_no_controller_up_and_catches_up_with_what_is_left() {
    const SAMPLES: u64 = 5_000;
    let site = DaemonSite::new();
    let daemon = daemon(&site);
    let host = site.host();
    let mut publisher = SamplePublisher::open(&host, TRAIN).unwrap();
    let mut reader = SnapshotReader::open(&host, TRAIN).unwrap();
    let mut publish = |count: u64| {
        for _ in 0..count {
            let mut sample = TrainSample::empty(TRAIN).with(SampleField::Speed, 20.0);
            sample.time_ns = publisher.published() as i64 * 1_000_000;
            publisher.publish(&mut sample).unwrap();
        }
    };
    publish(1);
    let mut await_sequence = |sequence: u64| {
        await_true(
            || {
                reader.poll();
                reader.readings(0).any(|it| it.snapshot.sample_sequence == sequence)
            },
            || format!("sample {sequence}: {}", daemon.errors()),
        );
        *reader.readings(0).next().unwrap().snapshot
    };
    await_sequence(1);
    daemon.stop();
    publish(SAMPLES - 1);
    daemon.signal(Signal::CONT);
    let it = await_sequence(SAMPLES);
    assert_eq!(it.samples_used + it.samples_rejected + it.samples_lost, SAMPLES, "{it:?}");
    assert!(it.samples_lost > 0, "more than the buffer holds was published meanwhile");
}

#[test]
fn what_dead_processes_of_another_directory_left_is_not_touched() {
    let (ours, others) = (DaemonSite::new(), DaemonSite::new());
    let other_client = others.start(PEER, &["client", "1", "5000"]);
    other_client.await_line("a first poll", |line| !line.is_empty());
    other_client.kill();
    let before = others.segments();
    assert!(!before.is_empty(), "a killed process leaves its segments");
    let mut daemon = daemon(&ours);
    assert!(daemon.end(Signal::TERM).success());
    assert_eq!(ours.segments(), Vec::<String>::new());
    assert_eq!(others.segments().len(), before.len());
}

#[test]
fn a_directory_that_cannot_be_used_is_named_by_everybody() {
    let site = DaemonSite::new();
    let config = site.write_config(1, "", ECHO);
    let file = site.write("a-file", "");
    // Not even root can make a directory in /proc.
    for root in ["/proc/dynocar", file.to_str().unwrap(), "relative/path"] {
        let variables = [("DYNOCAR_ROOT", root)];
        let run = ["run", "--config", config.to_str().unwrap()];
        for (program, arguments) in [(DYNOCAR, &run[..]), (DYNOCAR, &["health"])] {
            let mut process = site.start_with(program, arguments, &variables);
            assert_eq!(process.wait().code(), Some(1), "{root}");
            assert!(process.errors().contains(root), "{root}: {}", process.errors());
        }
        let mut peer = site.start_with(PEER, &["client", "1", "5000"], &variables);
        assert!(!peer.wait().success());
        assert!(peer.errors().contains("Directory") || peer.errors().contains("RootName"));
    }
}

/// A command in a mount namespace of its own whose /dev/shm is a tmpfs of this size; the reason,
/// where this user may not make one.
fn with_small_memory(size: &str, command: &str) -> Result<Command, String> {
    let script = format!("mount -t tmpfs -o size={size} none /dev/shm && {command}");
    let probe = Command::new("unshare")
        .args(["-m", "sh", "-c", "mount -t tmpfs -o size=4k none /dev/shm"])
        .output()
        .map_err(|error| format!("unshare: {error}"))?;
    if !probe.status.success() {
        return Err(String::from_utf8_lossy(&probe.stderr).into_owned());
    }
    let mut made = Command::new("unshare");
    made.args(["-m", "sh", "-c", &script]);
    Ok(made)
}

#[test]
fn a_full_shared_memory_is_reported_in_words_and_ends_nobody_by_a_signal() {
    let site = DaemonSite::new();
    let config = site.write_config(1, "", ECHO);
    let daemon = format!("exec {DYNOCAR} run --config {}", config.display());
    let client = format!("exec {PEER} client 1 1000");
    let controller = format!("exec {PEER} controller 1 1000");
    for (size, command) in
        [("4k", &daemon), ("1m", &daemon), ("3m", &daemon), ("64k", &client), ("2m", &controller)]
    {
        let output = match with_small_memory(size, command) {
            Ok(mut command) => command.env("DYNOCAR_ROOT", site.path().join("root")).output(),
            Err(reason) => return println!("not tried, no mount namespace here: {reason}"),
        };
        let output = output.unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        // The test's own programs end by a panic that names the error.
        let expected = if *command == daemon { 1 } else { 101 };
        assert_eq!(output.status.code(), Some(expected), "{size}: {}: {said}", output.status);
        let is_reported =
            said.contains("shared memory is full") || said.contains("SharedMemoryFull");
        assert!(is_reported, "{size}: {said}");
    }
}
