//! Eight trains at 200 Hz for any length of time, with injected faults: memory stays flat, latency does not drift,
//! every sample is accounted for.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::{ParameterSnapshot, SampleField, TrainId, TrainSample};
use dynocar_transport::{Host, monotonic_now_ns};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::process::Signal;

use super::Programs;
use crate::process::{DaemonSite, Process, await_true};

/// Trains served.
pub const TRAINS: u64 = 8;
/// Time between two samples of a train.
const PERIOD: Duration = Duration::from_millis(5);
/// Greatest time for which the daemon is stopped: longer than its buffers last.
const STOPPED_MAX_MS: u64 = 4_000;
/// Greatest growth of the memory after the first quarter, in KiB: pages of the allocator.
pub(super) const GROWTH_MAX_KIB: u64 = 2_048;
/// Pipelines of each train.
const KINDS: [&str; 4] = ["v_mils", "mass_kalman", "trajectory_kalman", "echo"];

/// Report of a run.
#[derive(Clone, Debug, Default)]
pub struct LoadReport {
    /// Samples published over all trains.
    pub offered: u64,
    /// Samples lost, over all trains, of the pipeline that lost most.
    pub lost: u64,
    /// Faults injected.
    pub faults: u64,
    /// Resident memory of the daemon in KiB, by quarter of the run.
    pub resident_kib: [u64; 4],
    /// Median latency from sample to snapshot in ns, by quarter.
    pub latency_p50_ns: [u64; 4],
    /// The 99th percentile of it.
    pub latency_p99_ns: [u64; 4],
}

impl LoadReport {
    fn set_latencies(&mut self, by_quarter: [Vec<u64>; 4]) {
        for (quarter, mut latencies_ns) in by_quarter.into_iter().enumerate() {
            latencies_ns.sort_unstable();
            let at = |share: f64| {
                let index = (latencies_ns.len() as f64 * share) as usize;
                latencies_ns.get(index).copied().unwrap_or(0)
            };
            self.latency_p50_ns[quarter] = at(0.5);
            self.latency_p99_ns[quarter] = at(0.99);
        }
    }
}

/// One train's controller.
struct Controller {
    train: TrainId,
    publisher: SamplePublisher,
    reader: SnapshotReader,
    start_ns: i64,
    speed_phase: f64,
}

impl Controller {
    fn open(host: &Host, train: TrainId) -> Self {
        Controller {
            train,
            publisher: SamplePublisher::open(host, train).expect("a publisher"),
            reader: SnapshotReader::open(host, train).expect("a reader"),
            start_ns: monotonic_now_ns(),
            speed_phase: train.0 as f64,
        }
    }

    /// Publishes a train that swings between 10 and 30 m/s, one sample in fifty of no use.
    fn cycle(&mut self, random: &mut ChaCha8Rng, latencies_ns: &mut Vec<u64>) {
        let time_ns = monotonic_now_ns();
        let time_s = (time_ns - self.start_ns) as f64 * 1e-9;
        let phase = time_s / 60.0 * std::f64::consts::TAU + self.speed_phase;
        let mut sample = TrainSample::empty(self.train)
            .with(SampleField::Speed, 20.0 - 10.0 * phase.cos())
            .with(SampleField::TractionForce, 80_000.0 * phase.sin().max(0.0) + 15_000.0)
            .with(SampleField::BrakeForce, 80_000.0 * (-phase.sin()).max(0.0))
            .with(SampleField::Gradient, 0.0);
        match random.random_range(0..200) {
            0 => sample.set(SampleField::Speed, f64::NAN),
            1 => sample.set(SampleField::TractionForce, 1e9),
            2 => sample.set(SampleField::Speed, 72.0),
            _ => {}
        }
        sample.time_ns = time_ns;
        if random.random_range(0..200) == 3 {
            sample.time_ns -= 20_000_000;
        }
        self.publisher.publish(&mut sample).expect("a sample to be taken");
        self.reader.poll();
        let newest = self.reader.readings(monotonic_now_ns()).next();
        if let Some(it) = newest.map(|reading| reading.snapshot)
            && it.sample_sequence > 0
        {
            latencies_ns.push((it.published_ns - it.sample_published_ns).max(0) as u64);
        }
    }
}

/// Resident memory of a process in KiB.
pub(super) fn resident_kib(process: &Process) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", process.id()));
    let status = status.expect("the daemon's status");
    let line = status.lines().find(|line| line.starts_with("VmRSS:")).expect("VmRSS");
    line.split_whitespace().nth(1).and_then(|word| word.parse().ok()).expect("KiB")
}

fn start_daemon(site: &DaemonSite, programs: &Programs) -> Process {
    let pipelines: String = KINDS
        .iter()
        .map(|kind| format!("[[pipelines]]\nkind = \"{kind}\"\nthread = \"all\"\n"))
        .collect();
    let text = format!("[[threads]]\nname = \"all\"\n{pipelines}");
    let config = site.write_config(TRAINS, "log = \"error\"", &text);
    let arguments = ["run", "--config", config.to_str().expect("a UTF-8 path")];
    site.start(programs.dynocar.to_str().expect("a UTF-8 path"), &arguments)
}

/// Runs for `seconds` seconds; faults begin after the first and end before the last seconds.
///
/// # Panics
///
/// When memory grows or a sample is not accounted for.
pub fn run(programs: &Programs, seconds: u64, seed: u64) -> LoadReport {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let site = DaemonSite::new();
    let daemon = start_daemon(&site, programs);
    let host = site.host();
    let mut controllers: Vec<_> =
        (1..=TRAINS).map(|id| Controller::open(&host, TrainId(id))).collect();
    await_true(
        || {
            controllers
                .iter_mut()
                .all(|it| it.reader.poll() > 0 || it.reader.readings(0).count() > 0)
        },
        || format!("the daemon: {}", daemon.errors()),
    );
    let mut report = LoadReport::default();
    let mut client: Option<Process> = None;
    let mut latencies_ns: [Vec<u64>; 4] = Default::default();
    let start = Instant::now();
    let mut due = start;
    let mut next_fault = start + Duration::from_secs(2);
    while start.elapsed() < Duration::from_secs(seconds) {
        let quarter = (4 * start.elapsed().as_secs() / seconds).min(3) as usize;
        for controller in &mut controllers {
            controller.cycle(&mut random, &mut latencies_ns[quarter]);
        }
        if Instant::now() >= next_fault {
            report.faults += 1;
            next_fault = Instant::now() + Duration::from_millis(random.random_range(500..4_000));
            match random.random_range(0..3) {
                0 => {
                    let stopped_ms_max = STOPPED_MAX_MS.min(100 * seconds);
                    stop_for_a_while(&daemon, stopped_ms_max, &mut controllers, &mut random);
                    due = Instant::now();
                }
                1 => {
                    // A client comes; the one before dies.
                    let peer = programs.peer.to_str().expect("a UTF-8 path");
                    let next = site.start(peer, &["client", "3", "1000000"]);
                    if let Some(before) = client.replace(next) {
                        before.kill();
                    }
                }
                // A burst of four hundred samples at once.
                _ => (0..50).for_each(|_| cycle_uncounted(&mut controllers, &mut random)),
            }
        }
        report.resident_kib[quarter] = report.resident_kib[quarter].max(resident_kib(&daemon));
        due += PERIOD;
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    }
    check_accounts(&mut controllers, &daemon, &mut report);
    report.set_latencies(latencies_ns);
    let growth = report.resident_kib[3].saturating_sub(report.resident_kib[1]);
    assert!(growth <= GROWTH_MAX_KIB, "seed {seed}: memory grows: {report:?}");
    report
}

/// A cycle of every controller, whose latency does not count.
fn cycle_uncounted(controllers: &mut [Controller], random: &mut ChaCha8Rng) {
    controllers.iter_mut().for_each(|it| it.cycle(random, &mut Vec::new()));
}

/// Stops the daemon while the controllers go on: samples beyond the buffers are lost, and counted.
fn stop_for_a_while(
    daemon: &Process,
    stopped_ms_max: u64,
    controllers: &mut [Controller],
    random: &mut ChaCha8Rng,
) {
    daemon.stop();
    // By number, not by time: a slow machine is to lose some as well.
    for _ in 0..random.random_range(0..stopped_ms_max) / 4 {
        cycle_uncounted(controllers, random);
        std::thread::sleep(PERIOD);
    }
    daemon.signal(Signal::CONT);
}

/// Every pipeline of every train has taken, refused or missed every sample, exactly.
fn check_accounts(controllers: &mut [Controller], daemon: &Process, report: &mut LoadReport) {
    for controller in controllers {
        let offered = controller.publisher.published();
        let mut found: HashMap<u32, ParameterSnapshot> = HashMap::new();
        await_true(
            || {
                controller.reader.poll();
                found = controller
                    .reader
                    .readings(monotonic_now_ns())
                    .map(|it| (it.snapshot.pipeline_index, *it.snapshot))
                    .collect();
                found.len() == KINDS.len() && found.values().all(|it| it.sample_sequence == offered)
            },
            || format!("sample {offered} of train {}: {}", controller.train, daemon.errors()),
        );
        for it in found.values() {
            let sum = it.samples_used + it.samples_rejected + it.samples_lost;
            assert_eq!(sum, offered, "train {}: {it:?}", controller.train);
            report.lost = report.lost.max(it.samples_lost);
        }
        report.offered += offered;
    }
}
