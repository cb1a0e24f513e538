//! The parts of a configuration: process, threads, pipelines, kept states.

use std::path::PathBuf;

use dynocar_estimators::EstimatorSettings;
use dynocar_shared::TrainId;
use serde::Deserialize;

use crate::shadow::rule::Rule;

/// Behaviour of a pipeline thread while no sample comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IdleStrategy {
    /// Polls for samples without pause: lowest latency, one whole core.
    Busy,
    /// Polls for a while, then sleeps until the controller wakes it.
    Adaptive,
    /// Sleeps at once: least processor time.
    Event,
}

impl std::fmt::Display for IdleStrategy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            IdleStrategy::Busy => "busy",
            IdleStrategy::Adaptive => "adaptive",
            IdleStrategy::Event => "event",
        })
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
        StateConfig {
            keep: true,
            directory: None,
            interval_s: default_interval_s(),
            age_max_h: 7 * 24,
        }
    }
}

/// Returns the interval in s at which the states that outlive the daemon are written.
pub(super) const fn default_interval_s() -> u64 {
    30
}

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
    /// Index of its thread in [`DaemonConfig::threads`](super::DaemonConfig::threads).
    pub thread: usize,
    /// The trains it serves.
    pub trains: Vec<TrainId>,
}
