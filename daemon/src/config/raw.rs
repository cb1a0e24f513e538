//! The shape of a configuration's text, before anything is checked.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Deserialize;

use super::{IdleStrategy, LogFormat};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawConfig {
    #[serde(default)]
    pub daemon: RawDaemon,
    #[serde(default)]
    pub trains: Vec<RawTrain>,
    #[serde(default)]
    pub threads: Vec<RawThread>,
    #[serde(default)]
    pub pipelines: Vec<RawPipeline>,
    #[serde(default)]
    pub quantities: RawQuantities,
    pub state: Option<RawState>,
    pub metrics: Option<RawMetrics>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawMetrics {
    pub listen: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawDaemon {
    pub root: Option<PathBuf>,
    pub log: String,
    pub log_format: LogFormat,
    pub idle: IdleStrategy,
    pub spin_us: u64,
    pub heartbeat_ms: u64,
    pub lock_memory: bool,
}

impl Default for RawDaemon {
    fn default() -> Self {
        RawDaemon {
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
}

/// Name of the pipeline that answers, by the quantity's name.
pub type RawQuantities = BTreeMap<String, String>;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawState {
    pub directory: PathBuf,
    #[serde(default = "default_interval_s")]
    pub interval_s: u64,
    #[serde(default = "default_age_max_h")]
    pub age_max_h: u64,
}

const fn default_interval_s() -> u64 {
    30
}

const fn default_age_max_h() -> u64 {
    7 * 24
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
