//! Estimates that outlive the daemon: one state file for each train.
//!
//! A thread of its own polls the published snapshots as any client does, and writes what is
//! validated (see [`KeptEstimate`]) from time to time; the pipeline threads know nothing of it.
//! The next daemon takes the file up when it is whole, of the same train, wheel set, model and
//! settings, and not too old; else it says why not and starts cold.
//!
//! # Layout
//!
//! - [`mod@file`]: the bytes: header, checksum, atomic replacement
//! - [`entry`]: the content: keys and estimates
//! - [`keeper`]: the thread that writes
//!
//! [`KeptEstimate`]: dynocar_core::pipeline::KeptEstimate

pub mod entry;
pub mod file;
pub mod keeper;

use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use dynocar_core::pipeline::KeptEstimate;
use dynocar_shared::TrainId;
use tracing::{info, warn};

use crate::config::{DaemonConfig, PipelineConfig, StateConfig, TrainConfig};
use entry::{ModelKey, StateContent, StoredEstimate};

/// Why a state file is refused; the daemon then starts cold.
#[derive(Debug, thiserror::Error)]
pub enum StateError {
    /// The system does not give or take the file.
    #[error("{path}: {action} failed: {source}")]
    System {
        /// The file or directory.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The file does not begin as a state file does.
    #[error("{path}: not a state file of Dynocar")]
    NotAState {
        /// The file.
        path: PathBuf,
    },
    /// The file is of another schema.
    #[error("{path}: state schema {found}, expected {expected}")]
    Schema {
        /// The file.
        path: PathBuf,
        /// Its schema.
        found: String,
        /// The schema of this release.
        expected: u32,
    },
    /// The file is longer or shorter than it was written.
    #[error("{path}: torn: expected {expected} bytes after the header, found {found}")]
    Torn {
        /// The file.
        path: PathBuf,
        /// Bytes by the header.
        expected: usize,
        /// Bytes there are.
        found: usize,
    },
    /// The content is not what was written.
    #[error("{path}: corrupt: checksum {saved:016x} saved, {calculated:016x} calculated")]
    Corrupt {
        /// The file.
        path: PathBuf,
        /// Checksum in the header.
        saved: u64,
        /// Checksum of the content.
        calculated: u64,
    },
    /// The content is whole but cannot be understood.
    #[error("{path}: {message}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What the reader says.
        message: String,
    },
    /// The file is of another train, wheel set or model.
    #[error("{path}: foreign: its {what} is {saved}, expected {ours}")]
    Foreign {
        /// The file.
        path: PathBuf,
        /// Which part of the key differs.
        what: &'static str,
        /// The file's.
        saved: String,
        /// The configuration's.
        ours: String,
    },
}

/// Seconds since 1970 by the system's clock, which is only used to tell how old a state is.
pub fn unix_now_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

/// Where a train's state lies.
pub fn path_of(directory: &Path, train: TrainId) -> PathBuf {
    directory.join(format!("train-{train}.state"))
}

/// Reads the state of a train.
///
/// # Errors
///
/// Why it is refused; a file that is not there is no error but an empty state.
pub fn load(directory: &Path, train: &TrainConfig) -> Result<Vec<StoredEstimate>, StateError> {
    let path = path_of(directory, train.id);
    let Some(text) = file::read(&path)? else { return Ok(Vec::new()) };
    let content = StateContent::from_text(&path, &text)?;
    content.require_key(&path, &ModelKey::of(train))?;
    Ok(content.estimates)
}

/// The states of all trains, taken up or refused; each refusal is logged.
pub fn load_all(state: &StateConfig, trains: &[TrainConfig]) -> Vec<Vec<StoredEstimate>> {
    let take_up = |train: &TrainConfig| {
        load(&state.directory, train).unwrap_or_else(|error| {
            warn!(train = train.id.0, "state refused, cold start: {error}");
            Vec::new()
        })
    };
    trains.iter().map(take_up).collect()
}

/// What of a train's state serves a pipeline now, its covariance widened by the time since; says
/// in the log why a stored estimate does not serve.
pub fn warm_start_of(
    config: &StateConfig,
    stored: &[StoredEstimate],
    pipeline: &PipelineConfig,
    now_s: f64,
) -> Option<KeptEstimate> {
    let found = stored.iter().find(|it| it.pipeline == pipeline.name)?;
    let (name, elapsed_s) = (pipeline.name.as_str(), now_s - found.estimated_unix_s);
    let hours = elapsed_s / 3600.0;
    let refusal = if found.settings != entry::settings_hash(&pipeline.estimator) {
        "its kind or settings were others".to_owned()
    } else if elapsed_s < -CLOCK_TOLERANCE_S {
        format!("it is {:.1} h in the future by this clock", -hours)
    } else if hours > config.age_max_h as f64 {
        format!("it is {hours:.1} h old, expected at most {} h", config.age_max_h)
    } else {
        info!(pipeline = name, train = found.train, age_s = elapsed_s.round(), "warm start");
        return Some(found.estimate.after(elapsed_s));
    };
    warn!(pipeline = name, train = found.train, "stored estimate refused, cold start: {refusal}");
    None
}

/// A clock may be set back by so many seconds without a word.
const CLOCK_TOLERANCE_S: f64 = 60.0;

/// The state configuration with the states it leads to, if the daemon keeps any.
pub struct Taken<'a> {
    /// The configuration.
    pub config: &'a StateConfig,
    /// Stored estimates by place of the train in the configuration.
    pub stored: Vec<Vec<StoredEstimate>>,
}

impl<'a> Taken<'a> {
    /// Takes the states up; `None` when the daemon is to keep none.
    pub fn up(config: &'a DaemonConfig) -> Option<Self> {
        let state = config.state.as_ref()?;
        Some(Taken { config: state, stored: load_all(state, &config.trains) })
    }
}
