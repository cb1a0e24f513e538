//! `dynocar learn`: a companion of the daemon that learns from recorded runs, and the times of its rounds.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use clap::Args;
use dynocar::cli::Failure;
use dynocar::cli::run::start_log;
use dynocar::config::DaemonConfig;
use dynocar::ending;
use dynocar::observing::{EventKind, ObservedTrain};
use dynocar::output::{print, require_files, write_file};
use dynocar_shared::vocabulary::EffectKind;
use tracing::{info, warn};

use super::threads::Threads;
use crate::learn::{
    Bounds, LearnError, Learner, LearnerRound, LearnerSettings, RoundOutcome, TrainRound, page,
};
use crate::report::PAGE_MARK;
use crate::report::provenance::own_command_line;

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
    let host = config.process.host().map_err(Failure::work)?;
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

/// Interval at which the process checks whether to stop.
const TURN: Duration = Duration::from_millis(100);
/// Interval at which the process reads the snapshots.
const LOOK: Duration = Duration::from_secs(2);
/// Time after a suspicion in which the runs are searched repeatedly, since the run that raised it is still being
/// recorded.
const AFTERMATH: Duration = Duration::from_secs(3600);
/// Interval of these searches.
const AGAIN: Duration = Duration::from_secs(60);
/// Seconds of a day.
const DAY_S: u64 = 86_400;

/// A time of each day, in UTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeOfDay {
    /// Seconds since midnight.
    second: u64,
}

impl FromStr for TimeOfDay {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let (hour, minute) = text.split_once(':')?;
            let number = |digits: &str, below: u64| {
                let is_plain = digits.len() == 2 && digits.bytes().all(|it| it.is_ascii_digit());
                digits.parse().ok().filter(|&number: &u64| is_plain && number < below)
            };
            Some(TimeOfDay { second: 3600 * number(hour, 24)? + 60 * number(minute, 60)? })
        };
        read().ok_or_else(|| "expected a time of the day in UTC, as 03:30".into())
    }
}

impl TimeOfDay {
    /// Returns the next instant at which it is that time.
    fn after(self, instant: SystemTime) -> SystemTime {
        let now_s = instant.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        let today_s = now_s / DAY_S * DAY_S + self.second;
        UNIX_EPOCH + Duration::from_secs(if today_s > now_s { today_s } else { today_s + DAY_S })
    }
}

/// Tells when a time of the day has come.
struct Daily {
    at: TimeOfDay,
    looked: SystemTime,
}

impl Daily {
    /// Returns whether a day. A clock that is set forward over the time of the day reaches it, and one that is set
    /// back reaches it again.
    fn is_due(&mut self, now: SystemTime) -> bool {
        let looked = std::mem::replace(&mut self.looked, now);
        self.at.after(looked) <= now
    }
}

/// Suspicions of a train's snapshots.
pub struct Suspicions {
    observed: ObservedTrain,
    /// The newest effect that was suspected.
    known: Option<EffectKind>,
}

impl Suspicions {
    /// Returns those of a train.
    pub fn new(observed: ObservedTrain) -> Self {
        Suspicions { observed, known: None }
    }

    /// Returns whether another effect is suspected than before.
    fn is_new(&mut self) -> bool {
        let changes = self.observed.poll().into_iter();
        let raised = changes.filter(|it| it.kind == EventKind::SuspicionRaised);
        let newest =
            raised.filter_map(|it| it.effect).next_back().filter(|it| self.known != Some(*it));
        if let Some(effect) = newest {
            self.known = newest;
            info!(train = self.observed.id.0, "suspected: {effect}");
        }
        newest.is_some()
    }
}

/// Runs rounds until it is asked to stop; `after_round` is called after each.
///
/// A round that fails is reported, and the next may not fail.
///
/// # Errors
///
/// Only those of `after_round`.
pub fn watch<E>(
    learner: &mut Learner,
    suspicions: &mut [Suspicions],
    at: Option<TimeOfDay>,
    stop: &AtomicBool,
    after_round: &mut dyn FnMut(&Learner, &LearnerRound) -> Result<(), E>,
) -> Result<(), E> {
    let is_stopped = || stop.load(Ordering::Relaxed);
    let mut is_due = true;
    let mut daily = at.map(|at| Daily { at, looked: SystemTime::now() });
    let mut looked = Instant::now();
    let (mut suspected, mut learned) = (None::<Instant>, Instant::now());
    while !is_stopped() {
        if looked.elapsed() >= LOOK {
            looked = Instant::now();
            // Every train is looked at, so that none of its suspicions is new twice.
            if suspicions.iter_mut().filter_map(|it| it.is_new().then_some(())).count() > 0 {
                (is_due, suspected) = (true, Some(looked));
            }
        }
        let is_fresh = suspected.is_some_and(|at| at.elapsed() < AFTERMATH);
        is_due |= is_fresh && learned.elapsed() >= AGAIN;
        is_due |= daily.as_mut().is_some_and(|it| it.is_due(SystemTime::now()));
        if is_due {
            is_due = false;
            let round = learner.round(SystemTime::now(), &is_stopped);
            learned = Instant::now();
            match round {
                Ok(round) => after_round(learner, &round)?,
                Err(error) => warn!("a round of learning failed, the next may not: {error}"),
            }
        }
        std::thread::sleep(TURN);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_of_the_day_comes_once_a_day() {
        let at: TimeOfDay = "03:30".parse().unwrap();
        let day = |seconds: u64| UNIX_EPOCH + Duration::from_secs(100 * DAY_S + seconds);
        assert_eq!(at.after(day(0)), day(12_600));
        assert_eq!(at.after(day(12_599)), day(12_600));
        assert_eq!(at.after(day(12_600)), day(DAY_S + 12_600));
        for wrong in ["", "3:30", "24:00", "03:60", "+3:30", "03:30:00"] {
            assert!(wrong.parse::<TimeOfDay>().is_err(), "{wrong}");
        }
        let mut daily = Daily { at, looked: day(12_000) };
        let looks = [12_599, 12_600, 12_601, 90_000, 40 * DAY_S, 41 * DAY_S, 0, 12_599, 12_601];
        let due = looks.map(|it| daily.is_due(day(it)));
        // Weeks ahead count once, and the way back reaches no time of the day.
        assert_eq!(due, [false, true, false, false, true, true, false, false, true]);
    }
}
