//! `dynocar learn`: a companion of the daemon that learns from recorded runs.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::SystemTime;

use clap::Args;
use dynocar_transport::Host;

use super::threads::Threads;
use crate::learn::round_schedule::{Suspicions, TimeOfDay, watch};
use crate::learn::{
    Bounds, LearnError, Learner, LearnerRound, LearnerSettings, RoundOutcome, TrainRound, page,
};
use crate::report::PAGE_MARK;
use crate::report::provenance::own_command_line;
use dynocar::cli::Failure;
use dynocar::cli::run::start_log;
use dynocar::config::DaemonConfig;
use dynocar::ending;
use dynocar::observing::ObservedTrain;
use dynocar::output::{print, require_files, write_file};

/// Turn recorded runs into candidate models, while trains run.
///
/// It learns at the start, when the daemon's residual monitor suspects something new, and at an hour of the day, and
/// puts effects that the model in force lacks into the store as a candidate.
#[derive(Debug, Args)]
pub struct LearnArguments {
    /// The daemon's configuration: the trains, their declared files, the log
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// The folder of recorded runs: datasets and recordings at any depth, a flight recorder's ring too
    #[arg(long, value_name = "DIR")]
    runs: PathBuf,
    /// The store of models, made when it is not there; else that of the configuration
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// Learn once and end
    #[arg(long)]
    once: bool,
    /// Learn at this time of each day, in UTC
    #[arg(long, value_name = "HH:MM", conflicts_with = "once")]
    at: Option<TimeOfDay>,
    /// Write the history of all models after each round: one HTML page that needs nothing else
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
}

/// Learns until it is asked to end or its terminal is gone, or once.
///
/// # Errors
///
/// A wrong configuration or name of a result is an input failure. A failure during the work ends a round; it ends the
/// command only if that was to learn once.
pub fn execute(arguments: &LearnArguments) -> Result<(), Failure> {
    arguments.threads.or_one().work(|| learn(arguments))?
}

fn learn(arguments: &LearnArguments) -> Result<(), Failure> {
    let config = DaemonConfig::load(&arguments.config)?;
    require_files(&[(&arguments.report, PAGE_MARK)])?;
    if !arguments.runs.is_dir() {
        let runs = arguments.runs.display();
        return Err(Failure::Input(format!("{runs}: expected the folder of recorded runs")));
    }
    let store = dynocar::cli::models::store(arguments.models.as_deref(), Some(&config))?;
    let _log = start_log(&config)?;
    let stop = ending::flag().map_err(Failure::work)?;
    let settings = LearnerSettings {
        store,
        runs: arguments.runs.clone(),
        trains: config.trains.iter().map(|train| (train.id, train.text.clone())).collect(),
        bounds: Bounds::default(),
        command: own_command_line(),
    };
    let mut learner = Learner::open(settings)?;
    let report = arguments.report.as_deref();
    if arguments.once {
        let round = learner.round(SystemTime::now(), &|| stop.load(Ordering::Relaxed))?;
        write_report(report, &learner)?;
        return Ok(print(&lines_of(&round))?);
    }
    let host = Host::of(config.process.root.as_deref()).map_err(Failure::work)?;
    let suspicions = config.trains.iter().map(|train| {
        ObservedTrain::open(&host, train.id).map(Suspicions::new).map_err(Failure::work)
    });
    let mut suspicions = suspicions.collect::<Result<Vec<_>, Failure>>()?;
    watch(&mut learner, &mut suspicions, arguments.at, &stop, &mut |learner, round| {
        // That there was nothing new is no news to a log.
        let is_new = |it: &TrainRound| it.outcome != RoundOutcome::NothingNew;
        for line in round.trains.iter().filter(|it| is_new(it)).map(of_train) {
            tracing::info!("{}", line.trim_end());
        }
        write_report(report, learner)
    })
}

impl From<LearnError> for Failure {
    fn from(error: LearnError) -> Self {
        Failure::work(error)
    }
}

fn write_report(file: Option<&Path>, learner: &Learner) -> Result<(), Failure> {
    let Some(file) = file else { return Ok(()) };
    let page = page::html(learner, SystemTime::now()).map_err(Failure::work)?;
    Ok(write_file(file, &page)?)
}

/// Returns a line for each train.
fn lines_of(round: &LearnerRound) -> String {
    let mut text: String = round.trains.iter().map(of_train).collect();
    if round.is_stopped {
        text += "stopped before the end; what was not concluded is looked at again\n";
    }
    text
}

fn of_train(round: &TrainRound) -> String {
    let TrainRound { train, runs, in_force, outcome } = round;
    let plural = if *runs == 1 { "" } else { "s" };
    let head = format!("train {train}: {runs} run{plural}, model {in_force} in force: ");
    let found = match outcome {
        RoundOutcome::NothingNew => "nothing new since the last time".into(),
        RoundOutcome::TooFewRuns => "too few runs to learn from".into(),
        RoundOutcome::Explained(it) => {
            let mut parts = vec![it.statement.clone()];
            parts.extend(it.candidate.map(|hash| format!("new candidate {hash}")));
            parts.extend(it.same_as.map(|hash| format!("model {hash} says so already")));
            if !it.events.is_empty() {
                parts.push(format!("new maintenance events: {}", it.events.len()));
            }
            parts.join(" | ")
        }
    };
    format!("{head}{found}\n")
}
