//! One trial: so many trains at one rate against one daemon.

use dynocar::config::IdleStrategy;
use dynocar_client::{SamplePublisher, SnapshotReader, monotonic_now_ns};
use dynocar_shared::services::PIPELINES_MAX;
use dynocar_shared::{PipelineKind, TrainId};
use dynocar_tests::process::Site;
use hdrhistogram::Histogram;

use super::traffic::{Traffic, TrafficPlan};
use crate::output::Failure;
use crate::rig::cores::{Cores, bind, prioritise};
use crate::rig::pipelines;
use crate::rig::quantiles::{histogram, record};
use crate::rig::site::{DaemonPlan, ThreadPlan, await_all, require, site, stop};
use crate::rig::usage::{self, ProcessUsage};

/// What is put on the daemon.
#[derive(Clone, Debug)]
pub struct TrialPlan {
    /// Number of trains.
    pub trains: u64,
    /// The traffic of each.
    pub traffic: TrafficPlan,
    /// How long, in s.
    pub seconds: f64,
    /// The pipelines; slow ones get a thread of their own.
    pub pipelines: Vec<PipelineKind>,
    /// What the daemon's threads do while no sample comes.
    pub idle: IdleStrategy,
    /// Where the publishers and the fast thread run.
    pub cores: Cores,
    /// Seed of jitter and bad samples.
    pub seed: u64,
}

/// What became of the samples of one pipeline, over all trains.
#[derive(Clone, Debug)]
pub struct PipelineOutcome {
    /// The pipeline.
    pub kind: PipelineKind,
    /// Samples published for its trains.
    pub offered: u64,
    /// Samples that entered the estimate.
    pub used: u64,
    /// Samples refused.
    pub rejected: u64,
    /// From appointed time to the poll that brought the snapshot.
    pub latency: Histogram<u64>,
    /// The same from the moment at which the sample left: without the publishers' own delays.
    pub since_leaving: Histogram<u64>,
}

impl PipelineOutcome {
    fn new(kind: PipelineKind) -> Self {
        let (latency, since_leaving) = (histogram(), histogram());
        PipelineOutcome { kind, offered: 0, used: 0, rejected: 0, latency, since_leaving }
    }

    /// Samples of which the pipeline gave no account: lost, and too late to be noticed as lost.
    pub fn missing(&self) -> u64 {
        self.offered.saturating_sub(self.used + self.rejected)
    }
}

/// What one trial brought.
#[derive(Clone, Debug)]
pub struct Trial {
    /// By pipeline.
    pub pipelines: Vec<PipelineOutcome>,
    /// Processor time of the daemon over wall time, in %; 100 is one core.
    pub cpu_percent: f64,
    /// Resident memory of the daemon after the first tenth, in bytes.
    pub rss_start_bytes: u64,
    /// Resident memory of the daemon at the end, in bytes.
    pub rss_bytes: u64,
    /// The latest that a sample left after its appointed time, in ns: beyond some ms the
    /// publishers themselves are at their limit.
    pub publisher_lag_ns: i64,
    /// For how long in s publishers and daemon were ready but had no processor, and the machine beneath took their
    /// cores away.
    pub waits_s: [f64; 3],
}

impl Trial {
    /// Samples of which some pipeline gave no account.
    pub fn missing(&self) -> u64 {
        self.pipelines.iter().map(PipelineOutcome::missing).sum()
    }
}

/// Appointed times that are remembered for each train.
const IN_FLIGHT: usize = 1 << 13;
/// How long after the last sample slow pipelines may go on without anything new.
const SETTLED_AFTER_NS: i64 = 1_000_000_000;

/// One train with its controller's two ends.
struct Train {
    publisher: SamplePublisher,
    reader: SnapshotReader,
    traffic: Traffic,
    appointed: Box<[i64]>,
    left: Box<[i64]>,
    /// Newest sample behind each pipeline's snapshot.
    seen: [u64; PIPELINES_MAX],
}

/// Name of the daemon's thread with the fast pipelines.
const FAST: &str = "fast";

/// Runs one trial; binds the calling thread.
///
/// # Errors
///
/// When a process or channel fails.
pub fn run(plan: &TrialPlan) -> Result<Trial, Failure> {
    let site = site();
    let mut daemon = daemon_plan(plan).start(&site)?;
    let mut trains = (1..=plan.trains)
        .map(|id| open_train(&site, TrainId(id), plan))
        .collect::<Result<Vec<_>, _>>()?;
    bind(plan.cores.controller);
    prioritise(plan.cores.priority);
    // Every pipeline sends a first, empty snapshot for every train.
    for train in &mut trains {
        await_all(&mut train.reader, &mut daemon, plan.pipelines.len(), |_| true)?;
    }
    let mut outcomes: Vec<PipelineOutcome> =
        plan.pipelines.iter().copied().map(PipelineOutcome::new).collect();
    let start_ns = monotonic_now_ns() + 600_000_000;
    for (index, train) in trains.iter_mut().enumerate() {
        let spread = index as f64 / plan.trains as f64;
        let id = TrainId(index as u64 + 1);
        train.traffic = Traffic::new(plan.traffic, id, spread, start_ns, plan.seed);
    }
    let waits_before_s = usage::waits_s(daemon.id(), FAST, plan.cores);
    let (mut lag_ns, mut early) = (0, ProcessUsage::default());
    let end_ns = start_ns + (plan.seconds * 1e9) as i64;
    let early_ns = start_ns + (plan.seconds * 1e8) as i64;
    let mut turn = 0;
    let mut early_at_ns = 0;
    loop {
        let now_ns = monotonic_now_ns();
        if now_ns >= end_ns {
            break;
        }
        if early_at_ns == 0 && now_ns >= early_ns {
            early = usage::of_process(daemon.id()).unwrap_or_default();
            early_at_ns = now_ns;
            require(&mut daemon)?;
        }
        for train in &mut trains {
            lag_ns = lag_ns.max(train.publish_due(now_ns)?);
        }
        turn = (turn + 1) % trains.len();
        trains[turn].poll(&mut outcomes);
    }
    let late = usage::of_process(daemon.id()).unwrap_or_default();
    let waits_s = usage::waits_s(daemon.id(), FAST, plan.cores);
    let waits_s = std::array::from_fn(|which| waits_s[which] - waits_before_s[which]);
    let wall_s = (monotonic_now_ns() - early_at_ns) as f64 * 1e-9;
    settle(&mut trains, &mut outcomes);
    for train in &trains {
        train.account(&mut outcomes);
    }
    drop(trains);
    stop(daemon)?;
    Ok(Trial {
        pipelines: outcomes,
        cpu_percent: 100.0 * (late.cpu_s - early.cpu_s) / wall_s,
        rss_start_bytes: early.rss_bytes,
        rss_bytes: late.rss_bytes,
        publisher_lag_ns: lag_ns,
        waits_s,
    })
}

/// Fast pipelines share a thread on the daemon's core; slow ones share another one.
fn daemon_plan(plan: &TrialPlan) -> DaemonPlan {
    let slow_kinds = pipelines::slow();
    let (slow, fast): (Vec<_>, Vec<_>) =
        plan.pipelines.iter().partition(|kind| slow_kinds.contains(kind));
    let thread = |name, core, priority, pipelines: Vec<PipelineKind>| ThreadPlan {
        name,
        core,
        idle: plan.idle,
        priority,
        pipelines,
    };
    let threads = [
        thread(FAST, Some(plan.cores.server), plan.cores.priority, fast),
        thread("slow", None, None, slow),
    ];
    let threads = threads.into_iter().filter(|thread| !thread.pipelines.is_empty()).collect();
    DaemonPlan { trains: plan.trains, threads, ..DaemonPlan::default() }
}

fn open_train(site: &Site, id: TrainId, plan: &TrialPlan) -> Result<Train, Failure> {
    Ok(Train {
        publisher: SamplePublisher::open(&site.host(), id)?,
        reader: SnapshotReader::open(&site.host(), id)?,
        traffic: Traffic::new(plan.traffic, id, 0.0, monotonic_now_ns(), plan.seed),
        appointed: vec![0; IN_FLIGHT].into(),
        left: vec![0; IN_FLIGHT].into(),
        seen: [0; PIPELINES_MAX],
    })
}

/// Polls until every pipeline has come to its train's last sample, or nothing new comes.
fn settle(trains: &mut [Train], outcomes: &mut [PipelineOutcome]) {
    let mut last_news_ns = monotonic_now_ns();
    while monotonic_now_ns() - last_news_ns < SETTLED_AFTER_NS {
        let mut is_done = true;
        for train in trains.iter_mut() {
            if train.poll(outcomes) {
                last_news_ns = monotonic_now_ns();
            }
            let newest = train.publisher.published();
            is_done &= train.seen[..outcomes.len()].iter().all(|&seen| seen >= newest);
        }
        if is_done {
            break;
        }
    }
}

impl Train {
    /// Publishes what is due; gives how late the latest was, in ns.
    fn publish_due(&mut self, now_ns: i64) -> Result<i64, Failure> {
        let mut lag_ns = 0;
        while self.traffic.next_ns() <= now_ns {
            let (mut sample, appointed_ns) = self.traffic.take();
            let sequence = self.publisher.publish(&mut sample)?;
            self.appointed[sequence as usize % IN_FLIGHT] = appointed_ns;
            self.left[sequence as usize % IN_FLIGHT] = sample.published_ns;
            lag_ns = lag_ns.max(sample.published_ns - appointed_ns);
        }
        Ok(lag_ns)
    }

    /// Takes what has come; a snapshot answers every sample up to the newest behind it.
    fn poll(&mut self, outcomes: &mut [PipelineOutcome]) -> bool {
        if self.reader.poll() == 0 {
            return false;
        }
        let now_ns = monotonic_now_ns();
        for reading in self.reader.readings(now_ns) {
            let index = reading.snapshot.pipeline_index as usize;
            let Some(outcome) = outcomes.get_mut(index) else { continue };
            let newest = reading.snapshot.sample_sequence;
            let oldest = (self.seen[index] + 1).max(newest.saturating_sub(IN_FLIGHT as u64 - 1));
            for sequence in oldest..=newest {
                let slot = sequence as usize % IN_FLIGHT;
                record(&mut outcome.latency, now_ns - self.appointed[slot]);
                record(&mut outcome.since_leaving, now_ns - self.left[slot]);
            }
            self.seen[index] = self.seen[index].max(newest);
        }
        true
    }

    fn account(&self, outcomes: &mut [PipelineOutcome]) {
        for reading in self.reader.readings(0) {
            let snapshot = reading.snapshot;
            if let Some(outcome) = outcomes.get_mut(snapshot.pipeline_index as usize) {
                outcome.offered += self.publisher.published();
                outcome.used += snapshot.samples_used;
                outcome.rejected += snapshot.samples_rejected;
            }
        }
    }
}
