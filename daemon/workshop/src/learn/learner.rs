//! A round of learning.

use std::fs::{File, TryLockError};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::answer::Verdict;
use dynocar_shared::TrainId;
use tracing::warn;

use super::LearnError;
use super::available_runs::{FoundRun, Places, report_unusable, runs_of};
use super::conclusion::{Conclusion, Explained};
use super::memory::LearnerMemory;
use super::pool::{self, Bounds, Declared, Pool};
use crate::report::provenance::hex;
use dynocar::models::{Action, ModelHash, ModelText, Store, TrainModels, UtcSecond};
use dynocar::storage::{Disk, Storage, StorageError};

/// Folder of the learner within the store's directory.
const OWN_FOLDER: &str = "learn";
/// Lock file of the learner that works on a store.
const LOCK_FILE: &str = "learner.lock";

/// Settings of a learner.
#[derive(Clone, Debug)]
pub struct LearnerSettings {
    /// The store of models.
    pub store: Store,
    /// The folder of datasets and recordings.
    pub runs: PathBuf,
    /// The trains, each with the model that the configuration declares.
    pub trains: Vec<(TrainId, ModelText)>,
    /// Bounds of the runs that are explained together.
    pub bounds: Bounds,
    /// The command, as the origin of a model names it.
    pub command: String,
}

/// Learns from recorded runs, round by round.
#[derive(Debug)]
pub struct Learner {
    settings: LearnerSettings,
    own: PathBuf,
    memory: LearnerMemory,
    _lock: File,
}

/// Result of a round.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnerRound {
    /// By train.
    pub trains: Vec<TrainRound>,
    /// True where it was stopped before its end.
    pub is_stopped: bool,
}

/// Result of a round for a train.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainRound {
    /// The train.
    pub train: TrainId,
    /// The model in force.
    pub in_force: ModelHash,
    /// The runs that there are.
    pub runs: usize,
    /// Outcome of the runs.
    pub outcome: RoundOutcome,
}

/// Outcome of the runs of a train.
#[derive(Clone, Debug, PartialEq)]
pub enum RoundOutcome {
    /// The same runs and model as the last time.
    NothingNew,
    /// Fewer than two runs.
    TooFewRuns,
    /// The runs were explained.
    Explained(Box<Explained>),
}

/// Ends an explanation from within.
struct Stopped;

impl Learner {
    /// Returns the learner of a store; there is one for each.
    ///
    /// # Errors
    ///
    /// When another learner is at work, or the store's directory cannot be written.
    pub fn open(settings: LearnerSettings) -> Result<Self, LearnError> {
        let own = settings.store.directory().join(OWN_FOLDER);
        let system = |path: &Path, action, source| {
            LearnError::Storage(StorageError { path: path.into(), action, source })
        };
        Disk.make_folder(&own).map_err(|it| system(&own, "making the folder", it))?;
        let path = own.join(LOCK_FILE);
        let lock = File::create(&path).map_err(|it| system(&path, "locking", it))?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(LearnError::Taken { path }),
            Err(TryLockError::Error(source)) => return Err(system(&path, "locking", source)),
        }
        let memory = LearnerMemory::load(&own);
        Ok(Learner { settings, own, memory, _lock: lock })
    }

    /// Returns the settings.
    pub fn settings(&self) -> &LearnerSettings {
        &self.settings
    }

    /// Returns the memory.
    pub fn memory(&self) -> &LearnerMemory {
        &self.memory
    }

    /// Looks at all runs that there are at an instant, and explains those of each train that has new ones
    /// or another model in force. `stop` is asked all the while, and ends the round when it says so; the
    /// next one begins where nothing was concluded.
    ///
    /// # Errors
    ///
    /// See [`LearnError`]; earlier entries of the round stay in the store.
    pub fn round(
        &mut self,
        now: SystemTime,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Result<LearnerRound, LearnError> {
        let mut round = LearnerRound { trains: Vec::new(), is_stopped: false };
        for (train, declared) in self.settings.trains.clone() {
            match self.train_round(train, &declared, UtcSecond::from_time(now), stop)? {
                Some(of_train) => round.trains.push(of_train),
                None => return Ok(LearnerRound { is_stopped: true, ..round }),
            }
        }
        Ok(round)
    }

    /// `None` where it was stopped.
    fn train_round(
        &mut self,
        train: TrainId,
        declared: &ModelText,
        now: UtcSecond,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<TrainRound>, LearnError> {
        let models = self.settings.store.train(train);
        let in_force = match models.in_force()? {
            Some(hash) => hash,
            // So that models that are updated from it have a parent in the store.
            None => models.put_declared(declared, now)?,
        };
        let bounds = self.settings.bounds;
        let trains: Vec<TrainId> = self.settings.trains.iter().map(|it| it.0).collect();
        let places = Places { runs: &self.settings.runs, own: &self.own, trains: &trains };
        let mut runs = runs_of(train, places, &mut self.memory, (now, bounds.horizon))?;
        self.memory.save(&self.own)?;
        if let Some(since) = since_adopted(&models)? {
            runs.retain(|run| run.recorded >= since);
        }
        let round_of = |outcome| TrainRound { train, in_force, runs: runs.len(), outcome };
        let choices = pool::choices(&runs, &bounds);
        let digest = digest(in_force, &choices);
        if self.memory.explained.get(&train.to_string()) == Some(&digest) {
            return Ok(Some(round_of(RoundOutcome::NothingNew)));
        }
        let outcome = match self.explained(&models, in_force, &choices, now, stop)? {
            Some(outcome) => outcome,
            None => return Ok(None),
        };
        self.memory.explained.insert(train.to_string(), digest);
        self.memory.save(&self.own)?;
        Ok(Some(round_of(outcome)))
    }

    /// Explains one choice of runs after the other until one shows an effect.
    fn explained(
        &mut self,
        models: &TrainModels,
        in_force: ModelHash,
        choices: &[Vec<FoundRun>],
        now: UtcSecond,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<RoundOutcome>, LearnError> {
        let text = models.text(in_force)?;
        let declared = Declared::new(&text, models.load(in_force)?);
        let mut outcome = RoundOutcome::TooFewRuns;
        for choice in choices {
            let found = match self.explained_pool(choice, &declared, stop) {
                Ok(found) => found,
                Err(Stopped) => return Ok(None),
            };
            let Some((pool, explanation)) = found else { continue };
            let verdict = explanation.answer.verdict;
            let conclusion = Conclusion {
                models,
                in_force,
                text: &text,
                pool: &pool,
                explanation: &explanation,
                command: &self.settings.command,
                now,
            };
            let explained = conclusion.draw(&self.memory)?;
            // The first statement of an open question stays; more runs may only settle it.
            if verdict == Verdict::Effect || outcome == RoundOutcome::TooFewRuns {
                outcome = RoundOutcome::Explained(Box::new(explained));
            }
            if verdict == Verdict::Effect {
                break;
            }
        }
        if let RoundOutcome::Explained(explained) = &outcome
            && let Some(question) = &explained.question
            && self.memory.ask(question)
        {
            let experiment = question.experiment.as_deref().unwrap_or("more runs");
            let statement = &question.statement;
            warn!(train = question.train, "open: {statement} To settle it: {experiment}");
        }
        Ok(Some(outcome))
    }

    /// Explains a choice of runs; a run that cannot be used is reported once and left out. `None` where too few are
    /// left.
    fn explained_pool(
        &mut self,
        choice: &[FoundRun],
        declared: &Declared,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<(Pool, Explanation)>, Stopped> {
        let progress = |_: f64, _: &str| {
            if stop() {
                resume_unwind(Box::new(Stopped));
            }
        };
        loop {
            let read = pool::read(choice, declared, &self.settings.bounds, &mut self.memory);
            let Some(pool) = read else { return Ok(None) };
            let work = AssertUnwindSafe(|| pool.explain(declared, &progress));
            let explained = match catch_unwind(work) {
                Ok(explained) => explained,
                Err(cause) if cause.is::<Stopped>() => return Err(Stopped),
                Err(cause) => resume_unwind(cause),
            };
            let unusable = match explained {
                Ok(explanation) => return Ok(Some((pool, explanation))),
                Err(unusable) => unusable,
            };
            let Some(run) = pool.runs.iter().find(|run| run.name == unusable.name) else {
                return Ok(None);
            };
            report_unusable(&mut self.memory, &run.key(), &unusable.problem);
        }
    }
}

/// When the model in force came to be so; `None` while nothing was decided. Only runs since then are
/// runs that it was meant for.
fn since_adopted(models: &TrainModels) -> Result<Option<UtcSecond>, LearnError> {
    let decisions = models.decisions()?;
    let mut changes = decisions.iter().filter(|(_, it)| it.action != Action::Rejected);
    Ok(changes.next_back().map(|(_, decision)| decision.at))
}

/// Returns a hash of the explained input: the model and the runs.
fn digest(in_force: ModelHash, choices: &[Vec<FoundRun>]) -> String {
    let runs: String = choices.iter().flatten().map(|run| format!("{}\n", run.key())).collect();
    hex(format!("{in_force}\n{runs}").as_bytes())
}
