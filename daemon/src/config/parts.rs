//! The parts of a configuration: threads, pipelines, what is kept.

use std::path::PathBuf;

use dynocar_estimators::EstimatorSettings;
use dynocar_shared::TrainId;
use serde::Deserialize;

use crate::shadow::rule::Rule;

/// What a pipeline thread does while no sample comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IdleStrategy {
    /// Looks for samples without pause: lowest latency, one whole core.
    Busy,
    /// Looks for a while, then sleeps until the controller wakes it.
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

/// Where and how estimates are kept over restarts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StateConfig {
    /// Directory of the state files; the usual one of the service or user when absent.
    pub directory: Option<PathBuf>,
    /// How often they are written, in s.
    pub interval_s: u64,
    /// An older estimate is not taken up, in h.
    pub age_max_h: u64,
}

/// The store of models, and what becomes of those on trial.
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
    /// What it does while no sample comes.
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
