//! Counters of the kernel for a pipeline thread at work, and messages of the daemon when the kernel refuses it a
//! privilege.

use std::time::Duration;

use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::{SampleField, TrainId, TrainSample};
use dynocar_tests::process::{DaemonSite, Process, await_true};
use dynocar_transport::monotonic_now_ns;

use crate::hold_the_cores;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const TRAIN: TrainId = TrainId(1);

const PIPELINES: &str = "[[threads]]\nname = \"measured\"\nidle = \"busy\"\npriority = 10\ncore = 0\n\
                         [[pipelines]]\nkind = \"rls\"\nthread = \"measured\"\n\
                         [[pipelines]]\nkind = \"mils\"\nthread = \"measured\"\n\
                         [[pipelines]]\nkind = \"residual_monitor\"\nthread = \"measured\"\n";

/// Returns the page faults and voluntary waits of the daemon's measured thread.
fn faults_and_waits(daemon: &Process) -> (u64, u64) {
    let tasks = std::fs::read_dir(format!("/proc/{}/task", daemon.id())).expect("a process");
    let task = tasks
        .flatten()
        .map(|task| task.path())
        .find(|task| std::fs::read_to_string(task.join("comm")).is_ok_and(|it| it == "measured\n"))
        .expect("the thread");
    let stat = std::fs::read_to_string(task.join("stat")).expect("stat");
    let fields: Vec<&str> = stat.rsplit(") ").next().expect("fields").split(' ').collect();
    // Fields 10 and 12 of proc(5), counted from 3.
    let faults = [fields[7], fields[9]].iter().map(|it| it.parse::<u64>().expect("a count")).sum();
    let status = std::fs::read_to_string(task.join("status")).expect("status");
    let waits = status
        .lines()
        .find_map(|line| line.strip_prefix("voluntary_ctxt_switches:"))
        .expect("a count");
    (faults, waits.trim().parse().expect("a count"))
}

/// A controller that publishes at a steady speed and waits for each answer.
struct Controller {
    publisher: SamplePublisher,
    reader: SnapshotReader,
}

impl Controller {
    fn connect(site: &DaemonSite) -> Self {
        let host = site.host();
        Controller {
            publisher: SamplePublisher::open(&host, TRAIN).unwrap(),
            reader: SnapshotReader::open(&host, TRAIN).unwrap(),
        }
    }

    fn cycles(&mut self, count: u64, daemon: &Process) {
        for _ in 0..count {
            let mut sample = TrainSample::empty(TRAIN).with(SampleField::Speed, 20.0);
            sample.time_ns = monotonic_now_ns();
            let sequence = self.publisher.publish(&mut sample).unwrap();
            let reader = &mut self.reader;
            let mut is_answered = || {
                reader.poll();
                let all = reader.readings(0).count() == 3;
                all && reader.readings(0).all(|it| it.snapshot.sample_sequence >= sequence)
            };
            // An answer comes in some µs: the measured thread is busy all the while.
            if (0..20).any(|_| {
                std::thread::sleep(Duration::from_micros(50));
                is_answered()
            }) {
                continue;
            }
            let errors = || format!("an answer; standard error:\n{}", daemon.errors());
            await_true(is_answered, errors);
        }
    }
}

#[test]
fn a_thread_at_work_neither_faults_nor_waits_once_it_is_warm() {
    let _cores = hold_the_cores();
    let site = DaemonSite::new();
    let config = site.write_config(1, "lock_memory = true", PIPELINES);
    let daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().unwrap()]);
    daemon.await_error("serving");
    let is_locked = daemon.errors().contains("memory locked");
    let mut controller = Controller::connect(&site);
    // More than the samples' ring holds: every place in it has been touched.
    controller.cycles(1_000, &daemon);
    std::thread::sleep(Duration::from_millis(300));
    let before = faults_and_waits(&daemon);
    controller.cycles(1_000, &daemon);
    let after = faults_and_waits(&daemon);
    assert_eq!(after.1 - before.1, 0, "a busy thread waited");
    // Without the privilege the kernel may put a page aside at any time.
    if is_locked {
        assert_eq!(after.0 - before.0, 0, "page faults with locked memory");
    }
}

#[test]
fn missing_privileges_are_named_with_their_price_and_the_daemon_serves() {
    let _cores = hold_the_cores();
    let site = DaemonSite::new();
    let config = site.write_config(1, "lock_memory = true", PIPELINES);
    let arguments = ["run", "--config", config.to_str().unwrap()];
    let daemon = site.start_without_real_time(DYNOCAR, &arguments);
    daemon.await_error("serving");
    for text in [
        "memory not locked: this process may lock 0 bytes; it needs CAP_IPC_LOCK",
        "no real-time priority",
        "LimitRTPRIO=10",
        "may hold this thread up for milliseconds",
    ] {
        assert!(daemon.errors().contains(text), "{text:?} in:\n{}", daemon.errors());
    }
    Controller::connect(&site).cycles(10, &daemon);
}
