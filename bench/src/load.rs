//! `dynocar-bench load`: many trains against one daemon. The load of several trains with some pipelines and its result,
//! the highest rate without loss, and how latency, load and memory grow with trains and pipelines.
//!
//! One process stands for all controllers: it publishes every train's samples at their appointed times and polls the
//! trains in turn, on a core of its own.

use clap::Args;
use dynocar::config::IdleStrategy;
use dynocar::output::report_line;
use dynocar_shared::PipelineKind;
use serde::Serialize;
use serde_json::{Value, json};

use crate::ending::{self, is_due};
use crate::open_loop::controller::TrialOutcome;
use crate::open_loop::traffic::TrafficPlan;
use crate::open_loop::trial::{Answerer, Extent, OpenLoopTrial, Setting, run};
use crate::output::{BenchError, OutputArguments, Record, expect, named, table};
use crate::rig;
use crate::rig::cores::{CoreArguments, Cores, in_thread};
use crate::statistics::{cells, for_people, pooled};

/// Synthetic trains against one daemon: samples used, refused and lost, and their latency.
#[derive(Debug, Args)]
pub struct LoadArguments {
    /// A short trial: a check that everything runs, not a measurement
    #[arg(long)]
    quick: bool,
    /// Number of trains
    #[arg(long, default_value_t = 8)]
    trains: u64,
    /// Samples a second of each train
    #[arg(long, default_value_t = 200.0, value_name = "HZ")]
    rate: f64,
    /// How long, in s
    #[arg(long, value_name = "S")]
    duration: Option<f64>,
    /// The pipelines, by name and with commas between; fast, slow or all for the groups
    #[arg(long, value_delimiter = ',', default_value = "all", value_name = "NAMES")]
    pipelines: Vec<String>,
    /// Idle strategy of the daemon's threads: busy, adaptive (spin, then sleep) or event
    #[arg(long, value_name = "STRATEGY", default_value = "adaptive")]
    idle: String,
    /// Samples that leave at once
    #[arg(long, default_value_t = 1, value_name = "N")]
    burst: u64,
    /// Share of samples that no validation should pass
    #[arg(long, default_value_t = 0.01, value_name = "SHARE")]
    bad: f64,
    /// Also search for the highest rate without loss
    #[arg(long)]
    search: bool,
    /// Also show growth with the number of trains and pipelines
    #[arg(long)]
    growth: bool,
    #[command(flatten)]
    place: CoreArguments,
    #[command(flatten)]
    output: OutputArguments,
}

/// The idle strategies by name.
const IDLE: [(&str, IdleStrategy); 3] = [
    ("busy", IdleStrategy::Busy),
    ("adaptive", IdleStrategy::Adaptive),
    ("event", IdleStrategy::Event),
];

/// Greatest delay of a sample, as a share of the period.
const JITTER: f64 = 0.1;
/// Each trial of a search or of the growth lasts at most so long, in s.
const TRIAL_SECONDS: f64 = 3.0;

impl LoadArguments {
    /// Puts the load on and measures.
    ///
    /// # Errors
    ///
    /// When the command line is wrong, or a process or channel fails; never because of a time or a
    /// loss.
    pub fn run(&self) -> Result<(), BenchError> {
        let load = self.load()?;
        let (mut all, mut text) = result(&load, &load.run()?);
        let seconds = load.extent.seconds.min(TRIAL_SECONDS);
        let short = Load { extent: Extent { seconds, ..load.extent }, ..load };
        if self.search && !is_due() {
            let found = highest_rate(&short)?;
            text += &format!(
                "highest rate without loss: {:.0} Hz a train, {:.0} samples/s\n",
                found.rate_hz, found.samples_per_s
            );
            all["search"] = json!(found);
        }
        if self.growth && !is_due() {
            let sizes = growth(&short)?;
            text += &table(&sizes);
            all["growth"] = json!(sizes);
        }
        self.output.give(&all, || text)
    }

    fn load(&self) -> Result<Load, BenchError> {
        let LoadArguments { trains, rate, burst, bad, .. } = *self;
        let seconds = self.duration.unwrap_or(if self.quick { 1.0 } else { 10.0 });
        expect((1..=256).contains(&trains), || format!("--trains {trains}: expected 1 to 256"))?;
        expect((0.1..=1e6).contains(&rate), || {
            format!("--rate {rate}: expected 0.1 to 1000000 Hz")
        })?;
        expect((0.0..=1.0).contains(&bad), || {
            format!("--bad {bad}: expected a share from 0 to 1")
        })?;
        expect((1..=1_000).contains(&burst), || {
            format!("--burst {burst}: expected 1 to 1000 samples")
        })?;
        expect(seconds > 0.0 && seconds <= 86_400.0, || {
            format!("--duration {seconds}: expected up to 86400 s")
        })?;
        Ok(Load {
            pipelines: rig::pipelines_by_names(&self.pipelines)?,
            idle: named("--idle", &self.idle, &IDLE)?,
            extent: Extent {
                trains,
                traffic: TrafficPlan { rate_hz: rate, jitter: JITTER, burst, bad_share: bad },
                warm_up_s: 0.6,
                seconds,
                cores: Cores::choose(&self.place),
                seed: self.place.seed,
            },
        })
    }
}

/// Several trains with some pipelines.
#[derive(Clone, Debug)]
struct Load {
    /// The pipelines of the daemon.
    pub pipelines: Vec<PipelineKind>,
    /// Idle strategy of its threads.
    pub idle: IdleStrategy,
    /// Extent of the load.
    pub extent: Extent,
}

impl Load {
    /// Puts it on a daemon.
    ///
    /// # Errors
    ///
    /// When a process or channel fails.
    pub fn run(&self) -> Result<OpenLoopTrial, BenchError> {
        let answerer = Answerer::Daemon(self.pipelines.clone(), None);
        let setting = Setting { answerer, idle: self.idle, companions: &[], candidates: 0 };
        in_thread(|| run(&setting, &self.extent, ending::flag()))
    }
}

const MEBIBYTE: f64 = 1024.0 * 1024.0;

/// Returns a trial, for machines and for people.
fn result(load: &Load, trial: &OpenLoopTrial) -> (Value, String) {
    let of = |since| load.pipelines.iter().zip(&trial.pipelines).map(move |it| pipeline(it, since));
    let records: Vec<Record> = of("appointed").chain(of("leaving")).collect();
    let (trains, rate_hz) = (load.extent.trains, load.extent.traffic.rate_hz);
    let seconds = load.extent.seconds;
    let [publishers_s, daemon_s] = trial.waits_s;
    let all = json!({
        "trains": trains,
        "rate_hz": rate_hz,
        "seconds": seconds,
        "pipelines": records,
        "cpu_percent": trial.cpu_percent,
        "rss_start_bytes": trial.rss_start_bytes,
        "rss_bytes": trial.rss_bytes,
        "publisher_lag_ns": trial.publisher_lag_ns,
        "waits": { "publishers_s": publishers_s, "daemon_s": daemon_s },
    });
    let text = format!(
        "{trains} trains at {rate_hz} Hz for {seconds} s\n{}\n\
         daemon: {:.0} % of a core, {:.1} MiB resident ({:.1} MiB at first); samples left at most {} \
         late\n\
         ready but without a processor: publishers {:.2} %, daemon {:.2} % of the time\n",
        table(&records),
        trial.cpu_percent,
        trial.rss_bytes as f64 / MEBIBYTE,
        trial.rss_start_bytes as f64 / MEBIBYTE,
        for_people(trial.publisher_lag_ns as f64),
        100.0 * publishers_s / seconds,
        100.0 * daemon_s / seconds
    );
    (all, text)
}

fn pipeline((kind, it): (&PipelineKind, &TrialOutcome), since: &str) -> Record {
    let counts = Record::default()
        .with("pipeline", kind)
        .with("since", since)
        .with("offered", it.offered)
        .with("used", it.used)
        .with("rejected", it.rejected)
        .with("lost", it.missing());
    cells(counts, if since == "leaving" { &it.from_publish } else { &it.from_appointed })
}

/// One size of the daemon's task, with the latency over all pipelines.
fn size(load: &Load, trial: &OpenLoopTrial) -> Record {
    let counts = Record::default()
        .with("trains", load.extent.trains)
        .with("pipelines", load.pipelines.len())
        .with("lost", trial.missing());
    cells(counts, &pooled(trial.pipelines.iter().map(|it| &it.from_appointed)))
        .number("% of a core", trial.cpu_percent, 1)
        .number("MiB", trial.rss_bytes as f64 / MEBIBYTE, 1)
}

/// Controllers that are later than this have themselves reached their limit, in ns.
const LAG_MAX_NS: i64 = 50_000_000;
/// Steps of halving the interval, once a rate with loss is known.
const STEPS: usize = 5;
/// Rates beyond this are not tried, in Hz for each train.
const RATE_MAX_HZ: f64 = 2e6;

/// The outcome of a search.
#[derive(Clone, Copy, Debug, Default, Serialize)]
struct HighestRate {
    /// Highest rate of each train at which nothing was lost, in Hz; 0 when the first was too high.
    pub rate_hz: f64,
    /// The same over all trains.
    pub samples_per_s: f64,
    /// Lowest rate at which something was lost or the controllers fell behind, in Hz.
    pub failed_at_hz: Option<f64>,
}

/// Doubles the rate until something is lost, then halves the interval.
///
/// # Errors
///
/// When a process or channel fails.
fn highest_rate(load: &Load) -> Result<HighestRate, BenchError> {
    let mut found = HighestRate::default();
    let mut steps = STEPS;
    let mut load = load.clone();
    while steps > 0 && load.extent.traffic.rate_hz < RATE_MAX_HZ && !is_due() {
        let rate_hz = load.extent.traffic.rate_hz;
        let trial = load.run()?;
        if is_due() {
            break;
        }
        let verdict = match (trial.missing() > 0, trial.publisher_lag_ns > LAG_MAX_NS) {
            (true, _) => "samples lost",
            (false, true) => "the publishers fall behind",
            (false, false) => "nothing lost",
        };
        report_line(&format!("{rate_hz:.0} Hz: {verdict}"));
        if verdict == "nothing lost" {
            found.rate_hz = rate_hz;
        } else {
            found.failed_at_hz = Some(rate_hz);
        }
        load.extent.traffic.rate_hz = match found.failed_at_hz {
            None => rate_hz * 2.0,
            Some(failed) => {
                steps -= 1;
                0.5 * (found.rate_hz + failed)
            }
        };
    }
    found.samples_per_s = found.rate_hz * load.extent.trains as f64;
    Ok(found)
}

/// Trials of one train up to the load's number, with one pipeline, half and all of them.
///
/// # Errors
///
/// When a process or channel fails.
fn growth(load: &Load) -> Result<Vec<Record>, BenchError> {
    let most = load.extent.trains;
    let fours = std::iter::successors(Some(1), |trains| Some(4 * trains));
    let mut counts: Vec<u64> = fours.take_while(|&trains| trains < most).collect();
    counts.push(most);
    let all = load.pipelines.len();
    let mut widths = vec![1, all.div_ceil(2), all];
    widths.dedup();
    let mut sizes = Vec::new();
    for &trains in &counts {
        for &width in &widths {
            let mut load = load.clone();
            load.extent.trains = trains;
            load.pipelines.truncate(width);
            report_line(&format!("{trains} trains, {width} pipelines"));
            let trial = load.run()?;
            if is_due() {
                return Ok(sizes);
            }
            sizes.push(size(&load, &trial));
        }
    }
    Ok(sizes)
}
