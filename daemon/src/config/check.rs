//! A whole configuration, checked from its text.

use std::collections::HashSet;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use dynocar_core::pipeline::SettingError;
use dynocar_dataset::dataset_diagnostic::diagnostics;
use dynocar_dataset::{DatasetDiagnostic, keys};
use dynocar_estimators::EstimatorSettings;
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::services::PIPELINES_MAX;
use dynocar_shared::{PipelineKind, TrainId};

use super::quantities::Answers;
use super::refusals::{Checker, ConfigError};
use super::{
    IdleStrategy, ModelsConfig, PipelineConfig, ProcessConfig, RawConfig, RawMetrics, RawModels,
    RawPipeline, RawQuantities, RawThread, RawTrain, StateConfig, ThreadConfig, USUAL_INTERVAL_S,
    apart,
};
use crate::dataset::{LoadError, read_text};
use crate::models::{ModelHash, ModelText};
use crate::shadow::rule::Rule;

/// A train that the daemon serves.
#[derive(Clone, Debug)]
pub struct TrainConfig {
    /// Its number on the channels.
    pub id: TrainId,
    /// Declared model.
    pub model: Arc<TrainModel>,
    /// The line it runs on, when known.
    pub track: Option<Arc<Track>>,
    /// Hash that identifies the model of train and line.
    pub model_hash: ModelHash,
    /// Text of the declared model, as its files spell it.
    pub text: ModelText,
    /// The models to be tried next to the one in force; those of the store when absent.
    pub candidates: Option<Vec<ModelHash>>,
    /// Set of wheels that the train runs on; estimates are not kept across a change. Empty when not given.
    pub wheel_set: String,
    /// The pipelines that answer a controller's questions, each by its number.
    pub answers: Answers,
}

/// A configuration, checked as a whole.
#[derive(Clone, Debug)]
pub struct DaemonConfig {
    /// The process.
    pub process: ProcessConfig,
    /// The trains.
    pub trains: Vec<TrainConfig>,
    /// The threads.
    pub threads: Vec<ThreadConfig>,
    /// Loopback address that hands out metrics; none when absent.
    pub metrics: Option<SocketAddr>,
    /// Estimates that outlive the daemon; none are kept when absent.
    pub state: Option<StateConfig>,
    /// The store of models; without it the declared model stays in force.
    pub models: Option<ModelsConfig>,
    /// The pipelines, by the number that their snapshots carry.
    pub pipelines: Vec<PipelineConfig>,
}

impl DaemonConfig {
    /// Reads and checks a configuration and the train and track files it names.
    ///
    /// # Errors
    ///
    /// See [`ConfigError`]; every message names the file and the expected value.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let text = read_text(path)
            .map_err(|problem| ConfigError::Unreadable { path: path.into(), problem })?;
        DaemonConfig::from_text(path, &text)
    }

    /// Reads the configuration of a daemon that is to be observed: the directories that it alone uses are not looked for.
    ///
    /// # Errors
    ///
    /// See [`ConfigError`].
    pub fn load_to_observe(path: &Path) -> Result<Self, ConfigError> {
        let text = read_text(path)
            .map_err(|problem| ConfigError::Unreadable { path: path.into(), problem })?;
        check(&Checker { path, text: &text, is_observer: true })
    }

    /// Returns the diagnostics of the declared trains and their lines, with each train.
    pub fn diagnostics(&self) -> Vec<(TrainId, DatasetDiagnostic)> {
        let found = |train: &TrainConfig| diagnostics(&train.model, train.track.as_deref(), []);
        let of_train = |train| found(train).into_iter().map(|it| (train.id, it));
        self.trains.iter().flat_map(of_train).collect()
    }

    /// Checks the text of a configuration, and the train and track files it names; `path` is the
    /// file it came from.
    ///
    /// # Errors
    ///
    /// See [`ConfigError`].
    pub fn from_text(path: &Path, text: &str) -> Result<Self, ConfigError> {
        check(&Checker { path, text, is_observer: false })
    }
}

/// Share of the error that a model must gain to count as better, unless set otherwise.
const USUAL_LEAST_GAIN: f64 = 0.1;
/// Trips between two mistakes unless set otherwise: twenty years of twenty-seven trips a day.
const USUAL_TRIPS_BETWEEN_MISTAKES: f64 = 200_000.0;
/// The most candidates of a train that are on trial at once, unless set otherwise.
const USUAL_CANDIDATES_MAX: u64 = 2;

/// The most pipeline threads that one sample channel serves.
const THREADS_MAX: usize = 10;

/// Checks the text of a configuration.
fn check(checker: &Checker) -> Result<DaemonConfig, ConfigError> {
    let Checker { path, text, .. } = *checker;
    let raw: RawConfig = toml::from_str(text).map_err(|error| checker.malformed("", &error))?;
    let (mut trains, named): (Vec<_>, Vec<_>) =
        check_trains(checker, raw.trains)?.into_iter().unzip();
    let process = ProcessConfig { file: path.into(), ..raw.daemon };
    process.check_root()?;
    if process.log_filter().is_none() {
        let allowed = "a level from off to trace, or levels by module, as dynocar=debug";
        return checker.refuse("daemon.log", format!("{:?}", process.log), allowed);
    }
    let mut threads = check_threads(checker, raw.threads, process.idle)?;
    let pipelines = check_pipelines(checker, raw.pipelines, &trains, &mut threads, process.idle)?;
    for (train, named) in trains.iter_mut().zip(&named) {
        train.answers = Answers::settle(checker, train.id, named, &raw.quantities, &pipelines)?;
    }
    apart::keep_slow_apart(checker, &pipelines, &threads)?;
    let in_use: HashSet<usize> = pipelines.iter().map(|pipeline| pipeline.thread).collect();
    if let Some(unused) = (0..threads.len()).find(|thread| !in_use.contains(thread)) {
        return checker.refuse("threads.name", &threads[unused].name, "a thread of a pipeline");
    }
    if threads.len() > THREADS_MAX {
        let allowed = format!("at most {THREADS_MAX} threads; let pipelines share one");
        return checker.refuse("threads", threads.len(), allowed);
    }
    let models = raw.models.map(|it| check_models(checker, it)).transpose()?;
    if models.is_none() && trains.iter().any(|train| train.candidates.is_some()) {
        return checker.refuse("trains.candidates", "models", "a store of models, [models]");
    }
    if models.is_some() && threads.len() == THREADS_MAX {
        let most = THREADS_MAX - 1;
        let allowed = format!("at most {most} threads beside the one that tries models");
        return checker.refuse("threads", threads.len(), allowed);
    }
    checker.range("daemon.spin_us", process.spin_us, 0, 1_000_000)?;
    checker.range("daemon.heartbeat_ms", process.heartbeat_ms, 5, 100)?;
    Ok(DaemonConfig {
        process,
        metrics: raw.metrics.map(|metrics| check_metrics(checker, metrics)).transpose()?,
        state: check_state(checker, raw.state)?,
        models,
        trains,
        threads,
        pipelines,
    })
}

/// Checks where metrics are handed out: on this host only.
fn check_metrics(checker: &Checker, raw: RawMetrics) -> Result<SocketAddr, ConfigError> {
    match raw.listen.parse::<SocketAddr>() {
        Ok(address) if address.ip().is_loopback() => Ok(address),
        _ => {
            let allowed = "a loopback address with a port, as 127.0.0.1:9464";
            checker.refuse("metrics.listen", raw.listen, allowed)
        }
    }
}

/// Checks where estimates are kept, if they are; a directory that is named must be there.
fn check_state(
    checker: &Checker,
    mut state: StateConfig,
) -> Result<Option<StateConfig>, ConfigError> {
    let existing = |named: PathBuf| checker.existing_directory("state.directory", &named);
    state.directory = state.directory.map(existing).transpose()?;
    checker.range("state.interval_s", state.interval_s, 1, 3_600)?;
    checker.range("state.age_max_h", state.age_max_h, 1, 10_000)?;
    Ok(state.keep.then_some(state))
}

/// Checks the trains; which pipelines answer for them is known only with the pipelines.
fn check_trains(
    checker: &Checker,
    raw: Vec<RawTrain>,
) -> Result<Vec<(TrainConfig, RawQuantities)>, ConfigError> {
    if raw.is_empty() {
        return checker.refuse("trains", "none", "at least one [[trains]] table");
    }
    let folder = checker.folder();
    let mut ids = HashSet::new();
    raw.into_iter()
        .map(|train| {
            if !ids.insert(train.id) {
                return checker.refuse("trains.id", train.id, "a number that no other train has");
            }
            let (file, line) = (folder.join(train.file), train.track.map(|it| folder.join(it)));
            let text = ModelText::read(&file, line.as_deref()).map_err(LoadError::from)?;
            let (model, track) =
                text.parse(&file, &line.unwrap_or_default()).map_err(LoadError::from)?;
            let config = TrainConfig {
                id: TrainId(train.id),
                model: Arc::new(model),
                track: track.map(Arc::new),
                model_hash: text.hash(),
                text,
                candidates: check_candidates(checker, train.candidates)?,
                wheel_set: train.wheel_set,
                answers: Answers::default(),
            };
            Ok((config, train.quantities))
        })
        .collect()
}

fn check_threads(
    checker: &Checker,
    raw: Vec<RawThread>,
    idle: IdleStrategy,
) -> Result<Vec<ThreadConfig>, ConfigError> {
    let mut names = HashSet::new();
    raw.into_iter()
        .map(|thread| {
            checker.core("threads.core", thread.core)?;
            if !names.insert(thread.name.clone()) {
                return checker.refuse("threads.name", thread.name, "a name of its own");
            }
            let idle = thread.idle.unwrap_or(idle);
            let priority = thread
                .priority
                .map(|priority| checker.range("threads.priority", priority, 1, 99))
                .transpose()?
                .map(|priority| priority as u8);
            Ok(ThreadConfig { name: thread.name, core: thread.core, idle, priority })
        })
        .collect()
}

/// Checks the pipelines; one that names no thread gets a thread of its own.
fn check_pipelines(
    checker: &Checker,
    raw: Vec<RawPipeline>,
    trains: &[TrainConfig],
    threads: &mut Vec<ThreadConfig>,
    idle: IdleStrategy,
) -> Result<Vec<PipelineConfig>, ConfigError> {
    if raw.is_empty() || raw.len() > PIPELINES_MAX {
        let allowed = format!("1 to {PIPELINES_MAX} [[pipelines]] tables");
        return checker.refuse("pipelines", raw.len(), allowed);
    }
    let named_threads = threads.len();
    let mut names = HashSet::new();
    raw.into_iter()
        .map(|pipeline| {
            let name = pipeline.name.unwrap_or_else(|| pipeline.kind.clone());
            if !names.insert(name.clone()) {
                return checker.refuse("pipelines.name", name, "a name that no other pipeline has");
            }
            let own = check_pipeline_trains(checker, &name, pipeline.trains, trains)?;
            let served = trains.iter().filter(|it| own.contains(&it.id));
            let RawPipeline { kind, settings, .. } = pipeline;
            let estimator = check_estimator(checker, &name, &kind, settings, served)?;
            let thread = match pipeline.thread {
                None => {
                    let name = name.clone();
                    threads.push(ThreadConfig { name, core: None, idle, priority: None });
                    threads.len() - 1
                }
                Some(thread) => {
                    let index = threads[..named_threads].iter().position(|it| it.name == thread);
                    match index {
                        Some(index) => index,
                        None => {
                            let key = format!("pipelines.{name}.thread");
                            return checker.refuse(key, &thread, apart::names_one(&thread));
                        }
                    }
                }
            };
            Ok(PipelineConfig { name, estimator, thread, trains: own })
        })
        .collect()
}

/// Checks an estimator's kind and its settings, with each train that it is to serve.
fn check_estimator<'t>(
    checker: &Checker,
    name: &str,
    kind: &str,
    mut settings: toml::Table,
    mut trains: impl Iterator<Item = &'t TrainConfig>,
) -> Result<EstimatorSettings, ConfigError> {
    let known = PipelineKind::from_name(kind).and_then(EstimatorSettings::default_of);
    if known.is_none() {
        let names: Vec<_> = PipelineKind::ALL
            .iter()
            .filter(|&&kind| EstimatorSettings::default_of(kind).is_some())
            .map(|kind| kind.name())
            .collect();
        let allowed = format!("one of {}", names.join(", "));
        return checker.refuse(format!("pipelines.{name}.kind"), kind, allowed);
    }
    settings.insert("kind".into(), toml::Value::String(kind.into()));
    let table = format!("pipelines.{name}.settings");
    let estimator: EstimatorSettings =
        settings.try_into().map_err(|error| checker.malformed(&table, &error))?;
    let refused = trains.find_map(|train| estimator.build(&train.model).err());
    refused.map_or(Ok(estimator), |SettingError { key, value, allowed }| {
        checker.refuse(format!("{table}.{key}"), value, allowed)
    })
}

fn check_pipeline_trains(
    checker: &Checker,
    name: &str,
    wanted: Option<Vec<u64>>,
    trains: &[TrainConfig],
) -> Result<Vec<TrainId>, ConfigError> {
    let declared: Vec<TrainId> = trains.iter().map(|train| train.id).collect();
    let Some(wanted) = wanted else { return Ok(declared) };
    if wanted.is_empty() {
        let key = format!("pipelines.{name}.trains");
        return checker.refuse(key, "[]", "at least one train, or no such key for all trains");
    }
    wanted
        .into_iter()
        .map(|id| {
            if declared.contains(&TrainId(id)) {
                return Ok(TrainId(id));
            }
            let ids: Vec<_> = declared.iter().map(TrainId::to_string).collect();
            let allowed = format!("the id of a [[trains]] table: {}", ids.join(", "));
            checker.refuse(format!("pipelines.{name}.trains"), id, allowed)
        })
        .collect()
}

/// Checks the store and the fate of models on trial; the directory must be there when the daemon starts.
fn check_models(checker: &Checker, raw: RawModels) -> Result<ModelsConfig, ConfigError> {
    let directory = checker.existing_directory("models.directory", &raw.directory)?;
    let least_gain = raw.least_gain.unwrap_or(USUAL_LEAST_GAIN);
    if !(0.0..=0.9).contains(&least_gain) {
        let allowed = "a share of the error, 0 to 0.9";
        return checker.refuse("models.least_gain", least_gain, allowed);
    }
    let trips_between_mistakes = raw.trips_between_mistakes.unwrap_or(USUAL_TRIPS_BETWEEN_MISTAKES);
    if !(20.0..=1e12).contains(&trips_between_mistakes) {
        let key = "models.trips_between_mistakes";
        return checker.refuse(key, trips_between_mistakes, "20 to 1e12 trips");
    }
    for (key, [low, high]) in &raw.bounds {
        let numbers = keys::TRAIN_TABLES.iter().flat_map(|table| keys::numbers_of(table));
        let mut numbers = numbers.map(keys::FileKey::from).chain([keys::brake::MAX_FORCE]);
        if numbers.all(|it| *key != format!("{}.{}", it.table, it.name)) {
            let allowed =
                "the table and the key of a number in a train's file, as \"resistance.a\"";
            return checker.refuse("models.bounds", format!("{key:?}"), allowed);
        }
        if !(low.is_finite() && high.is_finite() && low <= high) {
            let (key, given) = (format!("models.bounds.{key:?}"), format!("[{low}, {high}]"));
            return checker.refuse(key, given, "the least value, then the greatest");
        }
    }
    checker.core("models.core", raw.core)?;
    let candidates_max = raw.candidates_max.unwrap_or(USUAL_CANDIDATES_MAX);
    let interval_s = raw.interval_s.unwrap_or(USUAL_INTERVAL_S);
    let RawModels { adopt, core, bounds, .. } = raw;
    Ok(ModelsConfig {
        directory,
        rule: Rule { adopt, least_gain, trips_between_mistakes, bounds },
        candidates_max: checker.range("models.candidates_max", candidates_max, 0, 8)? as usize,
        core,
        interval_s: checker.range("models.interval_s", interval_s, 1, 3_600)?,
    })
}

/// Checks the models that a train names to be tried.
fn check_candidates(
    checker: &Checker,
    names: Option<Vec<String>>,
) -> Result<Option<Vec<ModelHash>>, ConfigError> {
    let hash = |name: String| match name.parse() {
        Ok(hash) => Ok(hash),
        Err(_) => checker.refuse(
            "trains.candidates",
            name,
            "the hash of a model, 16 hexadecimal digits, as `dynocar models list` names it",
        ),
    };
    names.map(|names| names.into_iter().map(hash).collect()).transpose()
}
