//! A controller or a client that a test may kill at any moment.
//!
//! `dynocar-test-peer controller TRAIN PERIOD_US` publishes for ever and prints every hundredth sequence number;
//! `dynocar-test-peer client TRAIN PERIOD_US` polls for ever and prints one line a poll: epoch, sequence, sample
//! sequence, used, lost, age in ms, stale, status, time of the poll and its length in ns. `dynocar-test-peer
//! controllers COUNT PERIOD_US` publishes for trains 1 to COUNT, and prints a line when all are open.
//! `dynocar-test-peer state-writer FOLDER` replaces a state file for ever.

use std::io::Write;
use std::time::Duration;

use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::{SampleField, TrainId, TrainSample};
use dynocar_transport::{Host, monotonic_now_ns};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [role, folder] = &arguments[..]
        && role == "state-writer"
    {
        return dynocar_tests::soak::state_kills::write_for_ever(std::path::Path::new(folder));
    }
    let [role, train, period_us] = &arguments[..] else {
        panic!("expected: controller|controllers|client TRAIN PERIOD_US, got {arguments:?}");
    };
    let number: u64 = train.parse().expect("a train number");
    let train = TrainId(number);
    let period = Duration::from_micros(period_us.parse().expect("a period in µs"));
    let host = Host::from_environment().expect("a run-time directory");
    match role.as_str() {
        "controller" => control(&host, train, period),
        "controllers" => control_many(&host, number, period),
        "client" => poll(&host, train, period),
        other => panic!("expected controller, controllers or client, got {other:?}"),
    }
}

/// Publishes a train that swings between 10 and 30 m/s.
fn control(host: &Host, train: TrainId, period: Duration) {
    let mut publisher = SamplePublisher::open(host, train).expect("a publisher");
    let start_ns = monotonic_now_ns();
    loop {
        publish(&mut publisher, train, start_ns);
        if publisher.published() % 100 == 1 {
            println!("{}", publisher.published());
        }
        std::thread::sleep(period);
    }
}

/// Publishes such a train under each number.
fn control_many(host: &Host, count: u64, period: Duration) {
    let open = |id| SamplePublisher::open(host, TrainId(id)).expect("a publisher");
    let mut publishers: Vec<SamplePublisher> = (1..=count).map(open).collect();
    println!("{count} controllers");
    let start_ns = monotonic_now_ns();
    loop {
        for (publisher, id) in publishers.iter_mut().zip(1..) {
            publish(publisher, TrainId(id), start_ns);
        }
        std::thread::sleep(period);
    }
}

fn publish(publisher: &mut SamplePublisher, train: TrainId, start_ns: i64) {
    let time_ns = monotonic_now_ns();
    let phase = (time_ns - start_ns) as f64 * 1e-9 / 60.0 * std::f64::consts::TAU;
    let mut sample = TrainSample::empty(train)
        .with(SampleField::Speed, 20.0 - 10.0 * phase.cos())
        .with(SampleField::Position, 5_000.0)
        .with(SampleField::TractionForce, 50_000.0)
        .with(SampleField::BrakeForce, 0.0);
    // The position stands for no motion here, so it is left out of the check.
    sample.valid &= !SampleField::Position.bit();
    sample.time_ns = time_ns;
    publisher.publish(&mut sample).expect("a sample to be taken");
}

fn poll(host: &Host, train: TrainId, period: Duration) {
    let mut reader = SnapshotReader::open(host, train).expect("a reader");
    let mut out = std::io::stdout().lock();
    loop {
        let before_ns = monotonic_now_ns();
        reader.poll();
        let now_ns = monotonic_now_ns();
        let poll_ns = now_ns - before_ns;
        match reader.readings(now_ns).next() {
            None => writeln!(out, "none {poll_ns}"),
            Some(reading) => {
                let it = reading.snapshot;
                writeln!(
                    out,
                    "{} {} {} {} {} {} {} {} {now_ns} {poll_ns}",
                    it.epoch,
                    it.sequence,
                    it.sample_sequence,
                    it.samples_used,
                    it.samples_lost,
                    reading.age_ns / 1_000_000,
                    reading.is_stale,
                    reading.status(),
                )
            }
        }
        .expect("standard output");
        std::thread::sleep(period);
    }
}
