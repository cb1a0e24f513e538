//! `dynocar-bench latency`: from the appointed time of a sample to the poll that brings its
//! snapshot, through real processes on cores of their own.
//!
//! Every round goes through all cases once, in an order drawn anew from the seed, so that the other work of the
//! machine falls on all of them alike. Ratios to the floor, an echo on the daemon's channels without an estimator, are
//! taken within a round; the median of the rounds is reported.
//!
//! - [`costs`]: one poll and one publish
//! - [`report`]: cases that are measured together, and the result, in numbers and as a picture

pub mod costs;
pub mod report;

use std::path::PathBuf;

use clap::Args;
use dynocar::config::IdleStrategy;
use dynocar::output::report_line;

use self::report::{LatencyCase, MeasuredCase, Rounds};
use crate::ending;
use crate::open_loop::traffic::TrafficPlan;
use crate::open_loop::trial::{Extent, run};
use crate::output::{BenchError, OutputArguments, expect};
use crate::rig::cores::{CoreArguments, Cores, bind, in_thread, prioritise};
use dynocar_tests::chance::Chance;

/// Sample → snapshot through real processes, compared with the floor and with alternatives.
#[derive(Debug, Args)]
pub struct LatencyArguments {
    /// Few short rounds of the main cases: a check that everything runs, not a measurement
    #[arg(long)]
    quick: bool,
    /// Samples a second
    #[arg(long, default_value_t = 1_000.0, value_name = "HZ")]
    rate: f64,
    /// Rounds through all cases
    #[arg(long, value_name = "N")]
    rounds: Option<usize>,
    /// Seconds of each case in each round
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Only the cases whose name contains this, and the floors
    #[arg(long, value_name = "TEXT")]
    case: Option<String>,
    /// Also measure with a recorder and a live view next to the daemon; their programs lie next to this one
    #[arg(long)]
    readers: bool,
    /// Also measure with two candidates on trial in the shadow of the daemon's model
    #[arg(long)]
    shadow: bool,
    #[command(flatten)]
    place: CoreArguments,
    #[command(flatten)]
    output: OutputArguments,
    /// Draw the distributions
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

impl LatencyArguments {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// When the command line is wrong, or a process or a transport fails; never because of a time.
    pub fn run(&self) -> Result<(), BenchError> {
        let rate = self.rate;
        expect((0.1..=1e6).contains(&rate), || {
            format!("--rate {rate}: expected 0.1 to 1000000 Hz")
        })?;
        let is_short = self.seconds.is_none_or(|seconds| seconds > 0.0 && seconds <= 3_600.0);
        expect(is_short, || "--seconds: expected up to 3600 s".into())?;
        expect(self.rounds != Some(0), || "--rounds 0: expected at least one round".into())?;
        let measured = self.measure()?;
        if let Some(file) = &self.plot {
            report::draw(&measured, file)?;
        }
        let (all, text) = report::summary(&measured);
        self.output.give(&all, || text)
    }

    fn measure(&self) -> Result<MeasuredCase, BenchError> {
        let choose = |quick: f64, usual: f64| if self.quick { quick } else { usual };
        let cores = Cores::choose(&self.place);
        let extent = Extent {
            trains: 1,
            traffic: TrafficPlan { rate_hz: self.rate, jitter: 0.0, burst: 1, bad_share: 0.0 },
            warm_up_s: choose(0.1, 0.8),
            seconds: self.seconds.unwrap_or(choose(0.1, 2.0)),
            cores,
            seed: self.place.seed,
        };
        let mut cases = report::cases(self.quick);
        if self.readers {
            cases.extend(report::cases_with_readers());
        }
        if self.shadow {
            cases.extend(report::cases_in_shadow());
        }
        let text = self.case.as_deref().unwrap_or_default();
        cases.retain(|case| case.name == "floor" || case.name.contains(text));
        let mut cases: Vec<_> = cases.into_iter().map(|case| (case, Vec::new())).collect();
        let costs = in_thread(|| {
            bind(cores.controller);
            prioritise(cores.priority);
            costs::measure(choose(20.0, 400.0) as usize)
        })?;
        let rounds = self.rounds.unwrap_or(choose(1.0, 15.0) as usize);
        run_rounds(&mut cases, rounds, &extent)?;
        if ending::is_due() {
            return Ok(MeasuredCase { cases, costs, at_rest: Vec::new(), extent });
        }
        let at_rest = [IdleStrategy::Adaptive, IdleStrategy::Event].map(|idle| {
            // Many seconds pass before the first sample of such a rate.
            let traffic = TrafficPlan { rate_hz: 1e-3, ..extent.traffic };
            let resting = Extent { traffic, seconds: choose(0.3, 5.0), ..extent };
            let trial =
                in_thread(|| run(&LatencyCase::all_fast(idle).setting, &resting, ending::flag()))?;
            Ok((idle.to_string(), trial.cpu_percent))
        });
        let at_rest = at_rest.into_iter().collect::<Result<_, BenchError>>()?;
        Ok(MeasuredCase { cases, costs, at_rest, extent })
    }
}

/// Adds a trial of every round to each case; once the program is to end, of the rounds that were whole.
fn run_rounds(cases: &mut [Rounds], rounds: usize, extent: &Extent) -> Result<(), BenchError> {
    let mut random = Chance::new(extent.seed);
    for round in 1..=rounds {
        report_line(&format!("round {round} of {rounds}"));
        for index in random.order(cases.len()) {
            let trial = in_thread(|| run(&cases[index].0.setting, extent, ending::flag()));
            if ending::is_due() {
                let whole = round - 1;
                if whole == 0 {
                    return Err("ended before the first round was over".into());
                }
                report_line(&format!("ended: figures of {whole} of {rounds} rounds"));
                cases.iter_mut().for_each(|(_, trials)| trials.truncate(whole));
                return Ok(());
            }
            cases[index].1.push(trial?);
        }
    }
    Ok(())
}
