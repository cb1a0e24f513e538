//! `dynocar-bench load`: many trains against one daemon.
//!
//! One process stands for all controllers: it publishes every train's samples at their appointed
//! times and polls the trains in turn, on a core of its own.
//!
//! - [`traffic`]: when a train's samples leave, and which are bad
//! - [`trial`]: so many trains at one rate against one daemon
//! - [`search`]: the highest rate without loss; growth with trains and pipelines
//! - [`report`]: the result

pub mod report;
pub mod search;
pub mod traffic;
pub mod trial;
pub mod waits;

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use dynocar::config::IdleStrategy;

use crate::rig::RigError;
use crate::rig::cores::{Cores, in_thread};
use crate::rig::host::HostGaps;
use crate::rig::pipelines;
use report::Report;
use traffic::TrafficPlan;
use trial::TrialPlan;

/// Synthetic trains against one daemon: what is used, refused and lost, and how late.
#[derive(Debug, Args)]
pub struct LoadArguments {
    /// A short trial: a check that everything runs, not a measurement
    #[arg(long)]
    pub quick: bool,
    /// Number of trains
    #[arg(long, default_value_t = 8)]
    pub trains: u64,
    /// Samples a second of each train
    #[arg(long, default_value_t = 200.0, value_name = "HZ")]
    pub rate: f64,
    /// How long, in s
    #[arg(long, value_name = "S")]
    pub duration: Option<f64>,
    /// The pipelines, by name and with commas between; fast, slow or all for the groups
    #[arg(long, value_delimiter = ',', default_value = "all", value_name = "NAMES")]
    pub pipelines: Vec<String>,
    /// What the daemon's threads do while no sample comes
    #[arg(long, value_enum, default_value_t = Idle::Adaptive)]
    pub idle: Idle,
    /// Greatest delay of a sample, as a share of the period
    #[arg(long, default_value_t = 0.1, value_name = "SHARE")]
    pub jitter: f64,
    /// Samples that leave at once
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub burst: u64,
    /// Share of samples that no validation should pass
    #[arg(long, default_value_t = 0.01, value_name = "SHARE")]
    pub bad: f64,
    /// Also search for the highest rate without loss
    #[arg(long)]
    pub search: bool,
    /// Also show growth with the number of trains and pipelines
    #[arg(long)]
    pub growth: bool,
    /// Core of the publishers
    #[arg(long, value_name = "CORE")]
    pub controller_core: Option<usize>,
    /// Core of the daemon's fast thread
    #[arg(long, value_name = "CORE")]
    pub daemon_core: Option<usize>,
    /// Real-time priority (SCHED_FIFO) of the publishers and of the daemon's fast thread, 1 to 99
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=99))]
    pub priority: Option<u8>,
    /// Seed of jitter and bad samples
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// An idle strategy on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Idle {
    /// Look all the time: the lowest latency, a whole core
    Busy,
    /// Look for a while, then sleep until the controller wakes them
    Adaptive,
    /// Sleep until the controller wakes them
    Event,
}

/// Why a load cannot be put on.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The command line is wrong.
    #[error("{0}")]
    Arguments(String),
    /// The measurement failed.
    #[error(transparent)]
    Rig(#[from] RigError),
}

const SECONDS: f64 = 10.0;
const QUICK_SECONDS: f64 = 1.0;
/// For so long at most the host is watched before and after a load, in s.
const HOST_SECONDS: f64 = 3.0;
/// Each trial of a search or of the growth lasts at most so long, in s.
const TRIAL_SECONDS: f64 = 3.0;

/// Puts the load on and measures.
///
/// # Errors
///
/// When the command line is wrong, or a process or channel fails; never because of a time or a
/// loss.
pub fn run(arguments: &LoadArguments) -> Result<Report, LoadError> {
    let plan = plan(arguments)?;
    let mut host = HostGaps::default();
    let watched_s = HOST_SECONDS.min(plan.seconds);
    host.watch(plan.cores, watched_s)?;
    let trial = in_thread(|| trial::run(&plan))?;
    host.watch(plan.cores, watched_s)?;
    let mut report = Report::of(&plan, &trial, host.figures());
    let short = TrialPlan { seconds: plan.seconds.min(TRIAL_SECONDS), ..plan };
    if arguments.search {
        report.search = Some(search::highest_rate(&short)?);
    }
    if arguments.growth {
        report.growth = Some(search::growth(&short)?);
    }
    Ok(report)
}

fn plan(arguments: &LoadArguments) -> Result<TrialPlan, LoadError> {
    let refuse = |text: String| Err(LoadError::Arguments(text));
    if !(1..=256).contains(&arguments.trains) {
        return refuse(format!("--trains {}: expected 1 to 256", arguments.trains));
    }
    if !(arguments.rate >= 0.1 && arguments.rate <= 1e6) {
        return refuse(format!("--rate {}: expected 0.1 to 1000000 Hz", arguments.rate));
    }
    for (name, share) in [("--jitter", arguments.jitter), ("--bad", arguments.bad)] {
        if !(0.0..=1.0).contains(&share) {
            return refuse(format!("{name} {share}: expected a share from 0 to 1"));
        }
    }
    if !(1..=1_000).contains(&arguments.burst) {
        return refuse(format!("--burst {}: expected 1 to 1000 samples", arguments.burst));
    }
    let default_s = if arguments.quick { QUICK_SECONDS } else { SECONDS };
    let seconds = arguments.duration.unwrap_or(default_s);
    if !(seconds > 0.0 && seconds <= 86_400.0) {
        return refuse(format!("--duration {seconds}: expected up to 86400 s"));
    }
    let pipelines = match arguments.pipelines.as_slice() {
        [name] if name == "all" => [pipelines::fast(), pipelines::slow()].concat(),
        [name] if name == "fast" => pipelines::fast(),
        [name] if name == "slow" => pipelines::slow(),
        names => pipelines::by_names(names)
            .map_err(|text| LoadError::Arguments(format!("--pipelines {text}")))?,
    };
    Ok(TrialPlan {
        trains: arguments.trains,
        traffic: TrafficPlan {
            rate_hz: arguments.rate,
            jitter: arguments.jitter,
            burst: arguments.burst,
            bad_share: arguments.bad,
        },
        seconds,
        pipelines,
        idle: match arguments.idle {
            Idle::Busy => IdleStrategy::Busy,
            Idle::Adaptive => IdleStrategy::Adaptive,
            Idle::Event => IdleStrategy::Event,
        },
        cores: Cores::choose(arguments.controller_core, arguments.daemon_core, arguments.priority),
        seed: arguments.seed,
    })
}
