//! `dynocar-bench latency`: from the appointed time of a sample to the poll that brings its
//! snapshot, through real processes on cores of their own.
//!
//! Every round goes through all cases once, in an order drawn anew from the seed, so that whatever
//! else the machine does falls on all of them alike. Ratios to the floor are taken within a round;
//! the median of the rounds is reported.
//!
//! - [`case`]: what is measured together with what
//! - [`companion`]: programs that read the same channels
//! - [`schedule`]: the open-loop measurement of one slice
//! - [`link`]: the controller's end of each transport
//! - [`server`]: the answering processes
//! - [`sockets`], [`plain`], [`bytes`]: what they need
//! - `zeromq`: both ends of ZeroMQ, with the feature of that name
//! - [`costs`]: one poll, one publish
//! - [`rest`]: what a daemon takes while no sample comes
//! - [`report`], [`plot`]: the result

pub mod bytes;
pub mod case;
pub mod companion;
pub mod costs;
pub mod link;
pub mod plain;
pub mod plot;
pub mod report;
pub mod rest;
pub mod schedule;
pub mod server;
pub mod sockets;
#[cfg(feature = "zeromq")]
pub mod zeromq;

use std::path::PathBuf;

use clap::Args;
use dynocar::config::IdleStrategy;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use crate::rig::RigError;
use crate::rig::cores::{Cores, bind, in_thread, prioritise};
use case::{Case, Outcome};
use costs::Costs;
use rest::AtRest;
use schedule::Schedule;

/// Sample → snapshot through real processes, compared with the floor and what a user would pick else.
#[derive(Debug, Args)]
pub struct LatencyArguments {
    /// Few short rounds of the main cases: a check that everything runs, not a measurement
    #[arg(long)]
    pub quick: bool,
    /// Samples a second
    #[arg(long, default_value_t = 1_000.0, value_name = "HZ")]
    pub rate: f64,
    /// Rounds through all cases
    #[arg(long, value_name = "N")]
    pub rounds: Option<usize>,
    /// Seconds of each case in each round
    #[arg(long, value_name = "S")]
    pub seconds: Option<f64>,
    /// Only the cases whose name contains this, and the floors
    #[arg(long, value_name = "TEXT")]
    pub case: Option<String>,
    /// Also measure with a recorder and a live view beside the daemon; their programs lie beside this one
    #[arg(long)]
    pub readers: bool,
    /// Also measure with two candidates on trial in the shadow of the daemon's model
    #[arg(long)]
    pub shadow: bool,
    /// Core of the controller
    #[arg(long, value_name = "CORE")]
    pub controller_core: Option<usize>,
    /// Core of the daemon's thread, and of whatever else answers
    #[arg(long, value_name = "CORE")]
    pub daemon_core: Option<usize>,
    /// Real-time priority (SCHED_FIFO) of the controller and of whatever answers, 1 to 99
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=99))]
    pub priority: Option<u8>,
    /// Seed of the order of the cases
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Draw the distributions
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
}

/// What was measured.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Each case with its outcome of every round.
    pub cases: Vec<(Case, Vec<Outcome>)>,
    /// What a call costs.
    pub costs: Costs,
    /// What a daemon takes while no sample comes.
    pub at_rest: Vec<AtRest>,
    /// How it was driven.
    pub schedule: Schedule,
    /// Where it ran.
    pub cores: Cores,
}

/// Why latency cannot be measured.
#[derive(Debug, thiserror::Error)]
pub enum LatencyError {
    /// The command line is wrong.
    #[error("{0}")]
    Arguments(String),
    /// The measurement failed.
    #[error(transparent)]
    Rig(#[from] RigError),
}

const ROUNDS: usize = 15;
const QUICK_ROUNDS: usize = 1;

/// Measures.
///
/// # Errors
///
/// When the command line is wrong, or a process or a transport fails; never because of a time.
pub fn run(arguments: &LatencyArguments) -> Result<Measured, LatencyError> {
    let refuse = |text: String| Err(LatencyError::Arguments(text));
    if !(arguments.rate >= 0.1 && arguments.rate <= 1e6) {
        return refuse(format!("--rate {}: expected 0.1 to 1000000 Hz", arguments.rate));
    }
    if arguments.seconds.is_some_and(|seconds| !(seconds > 0.0 && seconds <= 3_600.0)) {
        return refuse("--seconds: expected up to 3600 s".into());
    }
    if arguments.rounds == Some(0) {
        return refuse("--rounds 0: expected at least one round".into());
    }
    let cores = Cores::choose(arguments.controller_core, arguments.daemon_core, arguments.priority);
    let schedule = Schedule {
        rate_hz: arguments.rate,
        warm_up_s: if arguments.quick { 0.6 } else { 0.8 },
        measure_s: arguments.seconds.unwrap_or(if arguments.quick { 0.2 } else { 2.0 }),
    };
    let rounds = arguments.rounds.unwrap_or(if arguments.quick { QUICK_ROUNDS } else { ROUNDS });
    let mut cases: Vec<(Case, Vec<Outcome>)> =
        case::cases(arguments.quick).into_iter().map(|case| (case, Vec::new())).collect();
    if arguments.readers {
        cases.extend(case::cases_with_readers().into_iter().map(|case| (case, Vec::new())));
    }
    if arguments.shadow {
        cases.extend(case::cases_in_shadow().into_iter().map(|case| (case, Vec::new())));
    }
    if let Some(text) = &arguments.case {
        cases.retain(|(case, _)| case.name == "floor" || case.name.contains(text.as_str()));
    }
    let batches = if arguments.quick { 20 } else { 400 };
    let costs = in_thread(|| {
        bind(cores.controller);
        prioritise(cores.priority);
        costs::measure(batches)
    })?;
    let mut random = ChaCha8Rng::seed_from_u64(arguments.seed);
    for round in 1..=rounds {
        dynocar::output::report_line(&format!("round {round} of {rounds}"));
        let mut order: Vec<usize> = (0..cases.len()).collect();
        order.shuffle(&mut random);
        for index in order {
            let outcome = in_thread(|| case::measure(&cases[index].0, cores, &schedule))?;
            cases[index].1.push(outcome);
        }
    }
    let seconds = if arguments.quick { 0.5 } else { 5.0 };
    let at_rest = [IdleStrategy::Adaptive, IdleStrategy::Event]
        .into_iter()
        .map(|idle| rest::measure(idle, cores, seconds))
        .collect::<Result<_, _>>()?;
    Ok(Measured { cases, costs, at_rest, schedule, cores })
}
