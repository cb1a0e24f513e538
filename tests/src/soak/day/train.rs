//! One train of the day: its simulated runs, one after the other, with its own stamps.

use std::path::Path;
use std::time::{Duration, Instant};

use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};
use dynocar_transport::{Host, monotonic_now_ns};

use crate::process::{Process, WATCHDOG, await_true};
use crate::simulator::dataset_writer::write_dataset;
use crate::simulator::{Defects, EffectRequest, SimulatorSettings, TrainType, simulate};

/// Runs that a train repeats through the day.
const RUNS: usize = 4;
/// Time in ns between a run and the next.
const TURN_NS: i64 = 60_000_000_000;
/// Pause between two checks whether the daemon has taken the samples.
const PAUSE: Duration = Duration::from_micros(50);
/// Undeclared effects on the trains, in turn.
const EFFECTS: [EffectKind; 4] = [
    EffectKind::None,
    EffectKind::DraggingBrake,
    EffectKind::MassChange,
    EffectKind::WheelDiameter,
];

/// Samples used, rejected and lost, over all pipelines.
pub type TrainAccount = [u64; 3];

/// A train with its controller and a client of its snapshots.
pub struct DayTrain {
    host: Host,
    id: TrainId,
    /// `None` while nobody drives the train.
    publisher: Option<SamplePublisher>,
    reader: SnapshotReader,
    runs: Vec<Vec<TrainSample>>,
    /// Run and sample that come next.
    next: (usize, usize),
    /// From the stamps of the run to those of the day.
    offset_ns: i64,
    now_ns: i64,
    /// Samples published, and how many of them before this daemon.
    sequence: u64,
    before_daemon: u64,
    epoch: u64,
}

impl DayTrain {
    /// Simulates the train's runs, half of them recorded poorly, and writes its description into a
    /// folder.
    ///
    /// # Panics
    ///
    /// When the files cannot be written or the channels cannot be opened.
    pub fn new(host: &Host, number: u64, seed: u64, folder: &Path) -> Self {
        let index = number as usize;
        let kinds = vec![EFFECTS[index % EFFECTS.len()]];
        let is_poor = index / EFFECTS.len() % 2 == 1;
        let poor = Defects { outliers: 0.02, ..Defects::ALL };
        let simulated = simulate(&SimulatorSettings {
            train_type: Some(TrainType::ALL[index % TrainType::ALL.len()]),
            runs: RUNS,
            defects: if is_poor { poor } else { Defects::NONE },
            ..SimulatorSettings::new(seed + number, EffectRequest::Kinds(kinds))
        });
        write_dataset(&simulated, folder).expect("the train's files");
        let id = TrainId(number);
        DayTrain {
            host: host.clone(),
            id,
            publisher: Some(SamplePublisher::open(host, id).expect("a publisher")),
            reader: SnapshotReader::open(host, id).expect("a reader"),
            runs: simulated.runs.into_iter().map(|run| run.samples).collect(),
            next: (0, 0),
            offset_ns: 0,
            now_ns: 0,
            sequence: 0,
            before_daemon: 0,
            epoch: 0,
        }
    }

    /// Publishes up to `count` samples, none from a time in ns of the day on; returns false when there is none
    /// before.
    ///
    /// # Panics
    ///
    /// When the transport takes no sample.
    pub fn publish(&mut self, count: usize, end_ns: i64) -> bool {
        let Some(publisher) = &mut self.publisher else { return false };
        for _ in 0..count {
            if self.now_ns >= end_ns {
                return false;
            }
            let run = &self.runs[self.next.0];
            if self.next.1 == 0 {
                self.offset_ns = self.now_ns + TURN_NS - run[0].time_ns;
                publisher.start_run();
            }
            let mut sample = run[self.next.1];
            sample.time_ns += self.offset_ns;
            self.now_ns = sample.time_ns;
            self.sequence = publisher.publish(&mut sample).expect("a sample to be taken");
            self.next.1 += 1;
            if self.next.1 == run.len() {
                self.next = ((self.next.0 + 1) % self.runs.len(), 0);
            }
        }
        true
    }

    /// Waits until every pipeline has taken every sample, and adds the times in ns from sample to
    /// snapshot of the newest snapshots.
    ///
    /// # Panics
    ///
    /// When it does not come to it.
    pub fn follow(&mut self, daemon: &Process, latencies_ns: &mut Vec<u64>) {
        let Some(publisher) = &self.publisher else { return };
        let start = Instant::now();
        while publisher.untaken().is_none_or(|untaken| untaken > 0) {
            let failure = || format!("train {} is not followed: {}", self.id, daemon.errors());
            assert!(start.elapsed() < WATCHDOG, "{}", failure());
            std::thread::sleep(PAUSE);
        }
        self.reader.poll();
        for it in self.reader.readings(monotonic_now_ns()).map(|reading| reading.snapshot) {
            if it.sample_sequence > self.before_daemon {
                latencies_ns.push((it.published_ns - it.sample_published_ns).max(0) as u64);
            }
        }
    }

    /// The controller goes, or another comes; the day has gone on meanwhile.
    ///
    /// # Panics
    ///
    /// When the channel cannot be opened.
    pub fn set_driven(&mut self, is_driven: bool, now_ns: i64) {
        if is_driven && self.publisher.is_none() {
            let publisher = SamplePublisher::open(&self.host, self.id).expect("a publisher");
            assert_eq!(publisher.sequence(), self.sequence, "train {} is numbered on", self.id);
            self.publisher = Some(publisher);
            (self.next.1, self.now_ns) = (0, now_ns);
        } else if !is_driven {
            self.publisher = None;
        }
    }

    /// The controller's own clock is set back.
    pub fn set_back(&mut self, by_ns: i64) {
        self.offset_ns -= by_ns;
    }

    /// Waits until another daemon than before answers with `pipelines` pipelines.
    ///
    /// # Panics
    ///
    /// When none does.
    pub fn meet(&mut self, pipelines: usize, daemon: &Process) {
        let (id, before) = (self.id, self.epoch);
        await_true(
            || {
                self.reader.poll();
                let answering = self.reader.readings(monotonic_now_ns());
                let epochs = answering.filter(|it| !it.is_stale).map(|it| it.snapshot.epoch);
                let epochs: Vec<u64> = epochs.filter(|&epoch| epoch > before).collect();
                self.epoch = epochs.first().copied().unwrap_or(before);
                epochs.len() == pipelines
            },
            || format!("the daemon of train {id}: {}", daemon.errors()),
        );
        self.before_daemon = self.sequence;
    }

    /// Returns the counts of the pipelines of this daemon for the samples that were published since it came.
    ///
    /// # Panics
    ///
    /// When a sample is not accounted for.
    pub fn account(&mut self, pipelines: usize, daemon: &Process) -> TrainAccount {
        let offered = self.sequence - self.before_daemon;
        if offered == 0 {
            return TrainAccount::default();
        }
        let (id, sequence) = (self.id, self.sequence);
        let mut newest: Vec<ParameterSnapshot> = Vec::new();
        await_true(
            || {
                self.reader.poll();
                let readings = self.reader.readings(monotonic_now_ns());
                newest = readings.map(|it| *it.snapshot).collect();
                newest.len() == pipelines && newest.iter().all(|it| it.sample_sequence == sequence)
            },
            || format!("sample {sequence} of train {id}: {}", daemon.errors()),
        );
        let of = |it: &ParameterSnapshot| [it.samples_used, it.samples_rejected, it.samples_lost];
        let accounts: Vec<TrainAccount> = newest.iter().map(of).collect();
        for account in &accounts {
            assert_eq!(account.iter().sum::<u64>(), offered, "train {id}: {account:?}");
        }
        std::array::from_fn(|k| accounts.iter().map(|account| account[k]).sum())
    }

    /// Returns the samples published so far.
    pub fn published(&self) -> u64 {
        self.sequence
    }
}
