//! The shape of a configuration's text, before anything is checked.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Deserialize;

use super::parts::default_interval_s;
use super::{IdleStrategy, ProcessConfig, StateConfig};
use crate::shadow::rule::Adopt;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawConfig {
    #[serde(default)]
    pub daemon: ProcessConfig,
    #[serde(default)]
    pub trains: Vec<RawTrain>,
    #[serde(default)]
    pub threads: Vec<RawThread>,
    #[serde(default)]
    pub pipelines: Vec<RawPipeline>,
    #[serde(default)]
    pub quantities: RawQuantities,
    #[serde(default)]
    pub state: StateConfig,
    pub metrics: Option<RawMetrics>,
    pub models: Option<RawModels>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawMetrics {
    pub listen: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawTrain {
    pub id: u64,
    pub file: PathBuf,
    pub track: Option<PathBuf>,
    #[serde(default)]
    pub wheel_set: String,
    #[serde(default)]
    pub quantities: RawQuantities,
    pub candidates: Option<Vec<String>>,
}

/// Name of the pipeline that answers, by the quantity's name.
pub type RawQuantities = BTreeMap<String, String>;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawModels {
    pub directory: PathBuf,
    #[serde(default = "default_adopt")]
    pub adopt: Adopt,
    #[serde(default = "default_least_gain")]
    pub least_gain: f64,
    #[serde(default = "default_trips_between_mistakes")]
    pub trips_between_mistakes: f64,
    #[serde(default = "default_candidates_max")]
    pub candidates_max: u64,
    #[serde(default = "default_interval_s")]
    pub interval_s: u64,
    pub core: Option<usize>,
    #[serde(default)]
    pub bounds: BTreeMap<String, [f64; 2]>,
}

const fn default_adopt() -> Adopt {
    Adopt::Ask
}

const fn default_least_gain() -> f64 {
    0.1
}

/// Twenty years of twenty-seven trips a day.
const fn default_trips_between_mistakes() -> f64 {
    200_000.0
}

const fn default_candidates_max() -> u64 {
    2
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawThread {
    pub name: String,
    pub core: Option<usize>,
    pub idle: Option<IdleStrategy>,
    pub priority: Option<u64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawPipeline {
    pub name: Option<String>,
    pub kind: String,
    pub thread: Option<String>,
    pub trains: Option<Vec<u64>>,
    #[serde(default)]
    pub settings: toml::Table,
}
