//! A configuration and its trains.

use std::path::PathBuf;
use std::sync::Arc;

use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::TrainId;

use super::parts::{LogFormat, ModelsConfig, PipelineConfig, StateConfig, ThreadConfig};
use super::quantities::Answers;
use crate::models::{ModelHash, ModelText};

/// A train that the daemon serves.
#[derive(Clone, Debug)]
pub struct TrainConfig {
    /// Its number on the channels.
    pub id: TrainId,
    /// What is declared of it.
    pub model: Arc<TrainModel>,
    /// The line it runs on, when known.
    pub track: Option<Arc<Track>>,
    /// By what that model of train and line is known.
    pub model_hash: ModelHash,
    /// What the configuration declares, as its files spell it.
    pub text: ModelText,
    /// The models to be tried next to the one in force; those of the store when absent.
    pub candidates: Option<Vec<ModelHash>>,
    /// Which wheels it runs on; estimates are not kept across a change. Empty when not given.
    pub wheel_set: String,
    /// The pipelines that answer a controller's questions, each by its number.
    pub answers: Answers,
}

/// A configuration, checked as a whole.
#[derive(Clone, Debug)]
pub struct DaemonConfig {
    /// Run-time directory; the environment's when absent.
    pub root: Option<PathBuf>,
    /// Level of the log, as `info` or `dynocar=debug`.
    pub log: String,
    /// Form of the log.
    pub log_format: LogFormat,
    /// How long an adaptive thread looks for samples before it sleeps, in µs.
    pub spin_us: u64,
    /// How often a snapshot is vouched for while no sample comes, in ms.
    pub heartbeat_ms: u64,
    /// Keeps all memory of the daemon resident, so that no thread waits for a page.
    pub lock_memory: bool,
    /// The trains.
    pub trains: Vec<TrainConfig>,
    /// The threads.
    pub threads: Vec<ThreadConfig>,
    /// Loopback address that hands out metrics; none when absent.
    pub metrics: Option<std::net::SocketAddr>,
    /// Estimates that outlive the daemon; none are kept when absent.
    pub state: Option<StateConfig>,
    /// The store of models; without it what is declared stays in force.
    pub models: Option<ModelsConfig>,
    /// The pipelines, by the number that their snapshots carry.
    pub pipelines: Vec<PipelineConfig>,
}
