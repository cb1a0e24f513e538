//! A configuration and its trains.

use std::net::SocketAddr;
use std::sync::Arc;

use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::TrainId;

use super::parts::{ModelsConfig, PipelineConfig, ProcessConfig, StateConfig, ThreadConfig};
use super::quantities::Answers;
use crate::models::{ModelHash, ModelText};

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
