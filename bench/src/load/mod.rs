//! `dynocar-bench load`: many trains against one daemon.
//!
//! One process stands for all controllers: it publishes every train's samples at their appointed
//! times and polls the trains in turn, on a core of its own.
//!
//! - [`plan`]: the load of some trains with some pipelines, and its result
//! - [`search`]: the highest rate without loss; growth with trains and pipelines

pub mod plan;
pub mod search;

use clap::Args;
use dynocar::config::IdleStrategy;
use serde_json::json;

use self::plan::Load;
use crate::ending::is_due;
use crate::open_loop::traffic::TrafficPlan;
use crate::open_loop::trial::Extent;
use crate::output::{BenchError, OutputArguments, expect, named, table};
use crate::rig::cores::{CoreArguments, Cores};
use crate::rig::pipelines;

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
        let (mut all, mut text) = plan::result(&load, &load.run()?);
        let seconds = load.extent.seconds.min(TRIAL_SECONDS);
        let short = Load { extent: Extent { seconds, ..load.extent }, ..load };
        if self.search && !is_due() {
            let found = search::highest_rate(&short)?;
            text += &format!(
                "highest rate without loss: {:.0} Hz a train, {:.0} samples/s\n",
                found.rate_hz, found.samples_per_s
            );
            all["search"] = json!(found);
        }
        if self.growth && !is_due() {
            let sizes = search::growth(&short)?;
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
            pipelines: pipelines::by_names(&self.pipelines)?,
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
