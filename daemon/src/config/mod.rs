//! The daemon's configuration: `daemon.toml`.
//!
//! Unknown keys are refused; a value outside its range is refused with key, value and range.
//! File names inside the configuration are relative to the configuration file.
//!
//! # Layout
//!
//! - here: the parts of a configuration, as checked and as the text has them; a pipeline from its settings
//! - `check`: from the text to a [`DaemonConfig`]
//! - `refusals`: why a configuration is refused, and at which line
//! - `places`: the directories that it names
//! - `quantities`: the pipeline that answers each of a controller's questions
//! - `apart`: a thread of their own for slow pipelines

mod apart;
mod check;
mod places;
mod quantities;
mod refusals;

pub use apart::is_slow;
pub use check::{DaemonConfig, TrainConfig};
pub use quantities::Answers;
pub use refusals::{ConfigError, RootError};

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use dynocar_core::pipeline::{Pipeline, SettingError};
use dynocar_estimators::EstimatorSettings;
use dynocar_model::named;
use dynocar_shared::TrainId;
use serde::Deserialize;
use tracing_subscriber::filter::{LevelFilter, Targets};

use crate::shadow::rule::{Adopt, Rule};

named! {
    /// Behaviour of a pipeline thread while no sample comes.
    #[derive(Deserialize)]
    #[serde(rename_all = "snake_case")]
    IdleStrategy ("in the configuration") {
        /// Polls for samples without pause: lowest latency, one whole core.
        Busy "busy";
        /// Polls for a while, then sleeps until the controller wakes it.
        Adaptive "adaptive";
        /// Sleeps at once: least processor time.
        Event "event";
    }
}

impl std::fmt::Display for IdleStrategy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// How the daemon writes its log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LogFormat {
    /// Lines for people.
    Text,
    /// One JSON object a line.
    Json,
}

/// The process: the table `[daemon]`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ProcessConfig {
    /// The configuration's file; empty without one.
    #[serde(skip)]
    pub file: PathBuf,
    /// Run-time directory; the environment's when absent.
    pub root: Option<PathBuf>,
    /// Level of the log, as `info` or `dynocar=debug`.
    pub log: String,
    /// Form of the log.
    pub log_format: LogFormat,
    /// Idle strategy of the threads that do not set their own.
    pub idle: IdleStrategy,
    /// How long an adaptive thread looks for samples before it sleeps, in µs.
    pub spin_us: u64,
    /// How often a snapshot is vouched for while no sample comes, in ms.
    pub heartbeat_ms: u64,
    /// Keeps all memory of the daemon resident, so that no thread waits for a page.
    pub lock_memory: bool,
}

impl Default for ProcessConfig {
    fn default() -> Self {
        ProcessConfig {
            file: PathBuf::new(),
            root: None,
            log: "info".into(),
            log_format: LogFormat::Text,
            idle: IdleStrategy::Adaptive,
            spin_us: 2_000,
            heartbeat_ms: 50,
            lock_memory: false,
        }
    }
}

/// Where and how estimates are kept over restarts.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StateConfig {
    /// Whether they are.
    pub keep: bool,
    /// Directory of the state files; the usual one of the service or user when absent.
    pub directory: Option<PathBuf>,
    /// How often they are written, in s.
    pub interval_s: u64,
    /// An older estimate is not taken up, in h.
    pub age_max_h: u64,
}

impl Default for StateConfig {
    fn default() -> Self {
        StateConfig { keep: true, directory: None, interval_s: USUAL_INTERVAL_S, age_max_h: 7 * 24 }
    }
}

/// Time in s between two writings of the states that outlive the daemon, and of the trials, unless set otherwise.
const USUAL_INTERVAL_S: u64 = 30;

/// The store of models, and the treatment of models on trial.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelsConfig {
    /// The store's directory.
    pub directory: PathBuf,
    /// When a model is adopted or taken back.
    pub rule: Rule,
    /// The most candidates of a train that are on trial at once.
    pub candidates_max: usize,
    /// Processor core of the thread that tries them.
    pub core: Option<usize>,
    /// How often the trials are written down, in s.
    pub interval_s: u64,
}

impl ProcessConfig {
    /// Returns the filter of the log: a level, or levels by module; `None` for other words, which would be taken for the
    /// name of a module, and nothing would be logged.
    pub fn log_filter(&self) -> Option<Targets> {
        let is_level =
            |word: &str| !word.trim().is_empty() && word.trim().parse::<LevelFilter>().is_ok();
        let is_understood = |part: &str| match part.split_once('=') {
            Some((module, level)) => module.trim().starts_with("dynocar") && is_level(level),
            None => is_level(part),
        };
        let is_all_understood = self.log.split(',').all(is_understood);
        self.log.parse().ok().filter(|_| is_all_understood)
    }
}

/// A thread that serves pipelines.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ThreadConfig {
    /// Name, also shown by the operating system.
    pub name: String,
    /// Processor core that it is bound to.
    pub core: Option<usize>,
    /// Idle strategy of the thread.
    pub idle: IdleStrategy,
    /// Real-time priority (`SCHED_FIFO`), 1 to 99; the system's ordinary scheduling when absent.
    pub priority: Option<u8>,
}

/// A pipeline: one estimator for each of its trains.
#[derive(Clone, Debug)]
pub struct PipelineConfig {
    /// Name for people.
    pub name: String,
    /// Kind and settings of the estimator.
    pub estimator: EstimatorSettings,
    /// Index of its thread in [`DaemonConfig::threads`].
    pub thread: usize,
    /// The trains it serves.
    pub trains: Vec<TrainId>,
}

/// A configuration's text, before anything is checked.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawConfig {
    daemon: ProcessConfig,
    trains: Vec<RawTrain>,
    threads: Vec<RawThread>,
    pipelines: Vec<RawPipeline>,
    quantities: RawQuantities,
    state: StateConfig,
    metrics: Option<RawMetrics>,
    models: Option<RawModels>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMetrics {
    listen: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTrain {
    id: u64,
    file: PathBuf,
    track: Option<PathBuf>,
    #[serde(default)]
    wheel_set: String,
    #[serde(default)]
    quantities: RawQuantities,
    candidates: Option<Vec<String>>,
}

/// Name of the pipeline that answers, by the quantity's name.
type RawQuantities = BTreeMap<String, String>;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawModels {
    directory: PathBuf,
    #[serde(default)]
    adopt: Adopt,
    least_gain: Option<f64>,
    trips_between_mistakes: Option<f64>,
    candidates_max: Option<u64>,
    interval_s: Option<u64>,
    core: Option<usize>,
    #[serde(default)]
    bounds: BTreeMap<String, [f64; 2]>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawThread {
    name: String,
    core: Option<usize>,
    idle: Option<IdleStrategy>,
    priority: Option<u64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPipeline {
    name: Option<String>,
    kind: String,
    thread: Option<String>,
    trains: Option<Vec<u64>>,
    #[serde(default)]
    settings: toml::Table,
}

/// A setting of a pipeline is out of range.
#[derive(Debug, thiserror::Error)]
#[error("pipelines.{pipeline}.settings.{source}")]
pub struct SettingRefused {
    /// The pipeline's name.
    pub pipeline: String,
    /// Key, value and range.
    pub source: SettingError,
}

/// Returns a pipeline of the configuration for one of its trains, before its first sample; `index` is its
/// number in the configuration.
///
/// # Errors
///
/// When a setting is out of range.
pub fn build_pipeline(
    settings: &PipelineConfig,
    index: u32,
    train: &TrainConfig,
) -> Result<Pipeline, SettingRefused> {
    let estimator = settings
        .estimator
        .build(&train.model)
        .map_err(|source| SettingRefused { pipeline: settings.name.clone(), source })?;
    let (model, track) = (Arc::clone(&train.model), train.track.clone());
    let mut pipeline = Pipeline::new(train.id, index, model, track, estimator);
    let snapshot = pipeline.snapshot_mut();
    snapshot.quantities = train.answers.bits_of(index as usize);
    snapshot.train_quantities = train.answers.all_bits();
    snapshot.model_hash = train.model_hash.0;
    Ok(pipeline)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use tracing::Level;

    use super::*;

    #[test]
    fn a_mistyped_key_is_named_with_its_line_and_its_likely_meaning() {
        let refused = |text: &str| {
            DaemonConfig::from_text(Path::new("d.toml"), text).unwrap_err().to_string()
        };
        let train = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/demo/train.toml");
        let trains = format!("[[trains]]\nid = 1\nfile = {train:?}\n[[pipelines]]\n");
        let refusals = [
            ("nam = 1", "d.toml:5: unknown key 'nam'; did you mean 'name'? (choices: 'name', "),
            ("kind = 1", "d.toml:5: invalid type: integer "),
            (
                "kind = \"train_kalman\"\nsettings = { brake_lag = 1.0 }",
                "d.toml:6: pipelines.train_kalman.settings: unknown key 'brake_lag'; did you mean 'brake_lag_s'?",
            ),
            (
                "kind = \"train_kalman\"\nsettings = { brake_lag_s = -5.0 }",
                "d.toml:6: pipelines.train_kalman.settings.brake_lag_s = -5: expected 0.01 to 60 s",
            ),
            (
                "kind = \"train_kalmann\"",
                "d.toml:5: pipelines.train_kalmann.kind = train_kalmann: ",
            ),
        ];
        for (pipeline, words) in refusals {
            let refusal = refused(&format!("{trains}{pipeline}\n"));
            assert!(refusal.starts_with(words), "{refusal}");
        }
        assert_eq!(
            refused("[daemon]\nidle = \"bussy\"\n"),
            "d.toml:2: unknown value 'bussy'; did you mean 'busy'? (choices: 'busy', 'adaptive', 'event')"
        );
    }

    #[test]
    fn a_log_is_a_level_or_levels_by_module_and_nothing_else() {
        let filter =
            |log: &str| ProcessConfig { log: log.into(), ..Default::default() }.log_filter();
        let is_logged =
            |log: &str, level| filter(log).unwrap().would_enable("dynocar::run", &level);
        assert!(is_logged("info", Level::INFO) && !is_logged("info", Level::DEBUG));
        assert!(is_logged("dynocar=debug", Level::DEBUG));
        assert!(!is_logged("dynocar=debug", Level::TRACE));
        assert!(is_logged("dynocar::run=trace,warn", Level::TRACE));
        assert!(!is_logged("dynocar::runtime=trace,warn", Level::INFO));
        assert!(!is_logged("off", Level::ERROR));
        // Words that would be taken for modules, so that nothing would be logged.
        for wrong in ["infoo", "warning", "daemon=debug", "dynocar=loud", "info,foo=bar", ""] {
            assert!(filter(wrong).is_none(), "{wrong}");
        }
    }
}
