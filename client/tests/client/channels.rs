//! The channels between a controller and a daemon, both played by this process.

use std::any::Any;
use std::fs::{File, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::Barrier;
use std::time::Duration;

use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::services::SAMPLE_BUFFER;
use dynocar_shared::{
    ParameterSnapshot, PipelineKind, Reason, SampleField, Status, TrainId, TrainSample,
};
use dynocar_transport::channel::{Sender, Sleeper, Transport};
use dynocar_transport::{Host, monotonic_now_ns};

const TRAIN: TrainId = TrainId(11);

struct Bench {
    _directory: tempfile::TempDir,
    host: Host,
    transport: Transport,
}

fn bench() -> Bench {
    let directory = tempfile::tempdir().unwrap();
    let host = Host::at(directory.path()).unwrap();
    let transport = Transport::open(&host, "test-daemon").unwrap();
    Bench { _directory: directory, host, transport }
}

fn snapshot(epoch: u64, sequence: u64) -> ParameterSnapshot {
    let mut snapshot = ParameterSnapshot::empty();
    (snapshot.epoch, snapshot.sequence, snapshot.train_id) = (epoch, sequence, TRAIN.0);
    snapshot.pipeline_kind = PipelineKind::Rls as u32;
    snapshot.usable_quantities = dynocar_shared::Quantity::Resistance.bit();
    snapshot.status = Status::Estimated as u32;
    snapshot.published_ns = monotonic_now_ns();
    snapshot.vouched_ns = snapshot.published_ns;
    snapshot
}

#[test]
fn samples_arrive_in_order_with_their_numbers() {
    let bench = bench();
    let receiver = bench.transport.receiver::<TrainSample>(TRAIN).unwrap();
    let mut publisher = SamplePublisher::open(&bench.host, TRAIN).unwrap();
    for index in 0..100 {
        let mut sample = TrainSample::empty(TrainId(0)).with(SampleField::Speed, index as f64);
        publisher.publish(&mut sample).unwrap();
    }
    for index in 0..100 {
        let sample = receiver.receive().unwrap();
        assert_eq!((sample.sequence, sample.train_id), (index + 1, TRAIN.0));
        assert_eq!(sample.get(SampleField::Speed), Some(index as f64));
        assert!(sample.published_ns > 0);
    }
    assert_eq!(receiver.receive(), None);
}

#[test]
fn a_receiver_that_never_reads_loses_the_oldest_and_the_sender_goes_on() {
    let bench = bench();
    let receiver = bench.transport.receiver::<TrainSample>(TRAIN).unwrap();
    let mut publisher = SamplePublisher::open(&bench.host, TRAIN).unwrap();
    let sent = 3 * SAMPLE_BUFFER as u64;
    for _ in 0..sent {
        publisher.publish(&mut TrainSample::empty(TRAIN)).unwrap();
    }
    let first = receiver.receive().unwrap();
    assert_eq!(first.sequence, sent - SAMPLE_BUFFER as u64 + 1);
}

/// Segments of one kind in the host's shared memory.
fn segments(host: &Host, suffix: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir("/dev/shm").unwrap().map(|it| it.unwrap().path());
    let is_ours = |name: &str| name.starts_with(&host.segment_prefix()) && name.ends_with(suffix);
    entries.filter(|it| is_ours(it.file_name().unwrap().to_str().unwrap())).collect()
}

#[test]
fn ends_opened_at_once_are_connected_before_any_is_used() {
    const SENDERS: usize = 3;
    const RECEIVERS: usize = 5;
    let bench = bench();
    let open = |transport: &Transport, index: usize| -> Box<dyn Any> {
        match index < SENDERS {
            true => Box::new(transport.sender::<TrainSample>(TRAIN).unwrap()),
            false => Box::new(transport.receiver::<TrainSample>(TRAIN).unwrap()),
        }
    };
    for round in 0..20 {
        let (at_once, seen) =
            (Barrier::new(SENDERS + RECEIVERS), Barrier::new(SENDERS + RECEIVERS));
        let connections = |index: usize| {
            let transport = Transport::open(&bench.host, "test-end").unwrap();
            at_once.wait();
            let _end = open(&transport, index);
            at_once.wait();
            let connections = segments(&bench.host, ".connection").len();
            seen.wait();
            connections
        };
        std::thread::scope(|scope| {
            let connections = &connections;
            let ends: Vec<_> = (0..SENDERS + RECEIVERS)
                .map(|index| scope.spawn(move || connections(index)))
                .collect();
            for end in ends {
                assert_eq!(end.join().unwrap(), SENDERS * RECEIVERS, "round {round}");
            }
        });
    }
}

#[test]
fn what_a_killed_maker_left_incomplete_is_removed_before_the_next_port_is_made() {
    let bench = bench();
    let prefix = bench.host.segment_prefix();
    let leave = |name: &str, mode| {
        let path = Path::new("/dev/shm").join(format!("{prefix}{name}.connection"));
        std::fs::write(&path, [0; 302]).unwrap();
        std::fs::set_permissions(&path, Permissions::from_mode(mode)).unwrap();
        path
    };
    let (incomplete, complete) = (leave("incomplete", 0o200), leave("complete", 0o600));
    std::fs::write(bench.host.root().join("services.lock"), [0]).unwrap();
    let _sender = bench.transport.sender::<TrainSample>(TRAIN).unwrap();
    assert_eq!(segments(&bench.host, ".connection"), [complete], "{incomplete:?} is still there");
}

#[test]
fn a_process_stopped_while_it_opens_a_channel_is_named_by_its_lock() {
    let bench = bench();
    let lock = File::open(bench.host.root().join("services.lock")).unwrap();
    lock.lock().unwrap();
    let message = Transport::open(&bench.host, "test-controller").unwrap_err().to_string();
    assert!(message.contains("services.lock: another process holds this lock"), "{message}");
}

#[test]
fn a_second_controller_on_a_train_is_refused() {
    let bench = bench();
    let _first = SamplePublisher::open(&bench.host, TRAIN).unwrap();
    let message = SamplePublisher::open(&bench.host, TRAIN).unwrap_err().to_string();
    assert!(message.starts_with("train 11: already has a controller"), "{message}");
}

#[test]
fn a_late_reader_is_served_from_the_history() {
    let bench = bench();
    let sender: Sender<ParameterSnapshot> = bench.transport.sender(TRAIN).unwrap();
    sender.send(&snapshot(1, 1)).unwrap();
    let mut reader = SnapshotReader::open(&bench.host, TRAIN).unwrap();
    sender.serve_newcomers();
    assert_eq!(reader.poll(), 1);
    assert_eq!(reader.poll(), 0);
}

#[test]
fn the_reader_keeps_the_greatest_epoch_and_sequence() {
    let bench = bench();
    let mut reader = SnapshotReader::open(&bench.host, TRAIN).unwrap();
    let old: Sender<ParameterSnapshot> = bench.transport.sender(TRAIN).unwrap();
    let new: Sender<ParameterSnapshot> = bench.transport.sender(TRAIN).unwrap();
    new.send(&snapshot(2, 1)).unwrap();
    old.send(&snapshot(1, 900)).unwrap();
    reader.poll();
    let reading = reader.latest(PipelineKind::Rls, monotonic_now_ns()).unwrap();
    assert_eq!((reading.snapshot.epoch, reading.snapshot.sequence), (2, 1));
}

#[test]
fn a_silent_daemon_turns_the_estimate_invalid_with_its_age() {
    let bench = bench();
    let mut reader = SnapshotReader::open(&bench.host, TRAIN).unwrap();
    let sender: Sender<ParameterSnapshot> = bench.transport.sender(TRAIN).unwrap();
    sender.send(&snapshot(1, 1)).unwrap();
    reader.poll();
    let now_ns = monotonic_now_ns();
    assert!(reader.latest(PipelineKind::Rls, now_ns).unwrap().is_usable());
    let later = reader.latest(PipelineKind::Rls, now_ns + 1_000_000_000).unwrap();
    assert!(later.age_ns >= 1_000_000_000);
    assert_eq!((later.status(), later.reason()), (Status::Invalid, Some(Reason::DaemonSilent)));
}

#[test]
fn a_vouched_snapshot_is_younger_but_no_news() {
    let bench = bench();
    let mut reader = SnapshotReader::open(&bench.host, TRAIN).unwrap();
    let sender: Sender<ParameterSnapshot> = bench.transport.sender(TRAIN).unwrap();
    let mut same = snapshot(1, 7);
    sender.send(&same).unwrap();
    assert_eq!(reader.poll(), 1);
    same.vouched_ns += 50_000_000;
    sender.send(&same).unwrap();
    assert_eq!(reader.poll(), 0);
    let reading = reader.latest(PipelineKind::Rls, same.vouched_ns).unwrap();
    assert_eq!(reading.age_ns, 0);
}

#[test]
fn a_snapshot_that_cannot_be_true_is_refused_and_counted() {
    let bench = bench();
    let mut reader = SnapshotReader::open(&bench.host, TRAIN).unwrap();
    let sender: Sender<ParameterSnapshot> = bench.transport.sender(TRAIN).unwrap();
    let broken: [fn(&mut ParameterSnapshot); 4] = [
        |it| it.train_id = 12,
        |it| it.pipeline_index = 4000,
        |it| it.parameter_count = 7,
        |it| it.values[3] = f64::NAN,
    ];
    for breaks in broken {
        let mut message = snapshot(1, 1);
        breaks(&mut message);
        sender.send(&message).unwrap();
        assert_eq!(reader.poll(), 0);
    }
    assert_eq!(reader.refused(), 4);
    assert_eq!(reader.readings(0).count(), 0);
}

#[test]
fn a_sleeping_thread_is_woken_by_the_next_sample() {
    let bench = bench();
    let host = bench.host.clone();
    let (send_ready, ready) = std::sync::mpsc::channel();
    let thread = std::thread::spawn(move || {
        let transport = Transport::open(&host, "test-sleeper").unwrap();
        let receiver = transport.receiver::<TrainSample>(TRAIN).unwrap();
        let mut sleeper = Sleeper::open(&transport, &[TRAIN], 1).unwrap();
        send_ready.send(()).unwrap();
        let mut naps = 0;
        let sample = loop {
            let mut found = None;
            sleeper.sleep(Duration::from_secs(20), || {
                found = receiver.receive();
                found.is_some()
            });
            naps += 1;
            if let Some(sample) = found.or_else(|| receiver.receive()) {
                break sample;
            }
        };
        (sample.sequence, naps)
    });
    ready.recv().unwrap();
    let mut publisher = SamplePublisher::open(&bench.host, TRAIN).unwrap();
    // The thread reaches its bed at its own pace; each sample finds it there or on the way.
    let mut published = 0;
    while !thread.is_finished() {
        publisher.publish(&mut TrainSample::empty(TRAIN)).unwrap();
        published += 1;
        std::thread::sleep(Duration::from_millis(5));
    }
    let (sequence, naps) = thread.join().unwrap();
    assert!(sequence <= published);
    assert!(naps >= 1);
}
