//! Estimates that outlive the daemon: one state file for each train.
//!
//! A thread of its own polls the published snapshots as any client does, and writes the validated estimates (see
//! [`KeptEstimate`]) from time to time; the pipeline threads know nothing of it. A second copy in the run-time
//! directory, a second old at most, survives a daemon that dies at once. The next daemon takes the file up when it is
//! whole, of the same train, wheel set, model and settings, and not too old; otherwise it says why not and starts cold.
//!
//! # Layout
//!
//! - [`prepare`]: the directories where the files lie, and the daemon's right to keep states there
//! - [`mod@file`]: the bytes of a file: header, checksum, atomic replacement
//! - [`entry`]: the content of a file: keys and estimates
//! - [`keeper`]: the thread that writes
//!
//! [`KeptEstimate`]: dynocar_core::pipeline::KeptEstimate

pub mod entry;
pub mod file;
pub mod keeper;

pub use file::{StateError, StateProblem};

use std::ffi::OsString;
use std::fs::DirBuilder;
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

use dynocar_core::pipeline::KeptEstimate;
use dynocar_shared::TrainId;
use dynocar_transport::Host;
use rustix::fs::{Access, access};
use tracing::{info, warn};

use crate::config::{DaemonConfig, PipelineConfig, StateConfig, TrainConfig};
use crate::stamp::Stamp;
use entry::{ModelKey, StateContent, StoredEstimate};

/// Returns where a train's state lies.
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
    content.require_key(&path, &ModelKey::from_train(train))?;
    Ok(content.estimates)
}

/// The states of all trains, taken up or refused, of each pipeline the newest of all directories; each refusal is
/// logged.
pub fn load_all(directories: [&Path; 2], trains: &[TrainConfig]) -> Vec<Vec<StoredEstimate>> {
    let take_up = |train: &TrainConfig| {
        let mut newest: Vec<StoredEstimate> = Vec::new();
        for directory in directories {
            let found = load(directory, train).unwrap_or_else(|error| {
                warn!(train = train.id.0, "state refused, cold start: {error}");
                Vec::new()
            });
            for it in found {
                match newest.iter_mut().find(|known| known.pipeline == it.pipeline) {
                    Some(known) if known.estimated.seconds_to(&it.estimated) <= 0.0 => {}
                    Some(known) => *known = it,
                    None => newest.push(it),
                }
            }
        }
        newest
    };
    trains.iter().map(take_up).collect()
}

/// Returns the part of a train's state that serves a pipeline now, its covariance widened by the time since; logs
/// why a stored estimate does not serve.
pub fn warm_start_of(
    config: &StateConfig,
    stored: &[StoredEstimate],
    pipeline: &PipelineConfig,
    now: &Stamp,
) -> Option<KeptEstimate> {
    let found = stored.iter().find(|it| it.pipeline == pipeline.name)?;
    let (name, elapsed_s) = (pipeline.name.as_str(), found.estimated.seconds_to(now));
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

/// A clock may be set back by this many seconds without a message.
const CLOCK_TOLERANCE_S: f64 = 60.0;

/// The state configuration with the states it leads to, if the daemon keeps any.
pub struct Taken<'a> {
    /// The configuration.
    pub config: &'a StateConfig,
    /// Where the states lie.
    pub directory: PathBuf,
    /// Stored estimates by index of the train in the configuration.
    pub stored: Vec<Vec<StoredEstimate>>,
}

impl<'a> Taken<'a> {
    /// Takes the states up; `None` when the daemon is to keep none, or cannot, which the log says.
    pub fn up(config: &'a DaemonConfig, host: &Host) -> Option<Self> {
        let state = config.state.as_ref()?;
        match prepare(state.directory.as_deref()) {
            Ok(directory) => {
                info!(directory = %directory.display(), "state");
                let stored = load_all([&directory, host.root()], &config.trains);
                Some(Taken { config: state, directory, stored })
            }
            Err(error) => {
                warn!("no state is kept, a restart learns anew: {error}");
                None
            }
        }
    }
}

/// Why no state is kept.
#[derive(Debug, thiserror::Error)]
pub enum PlaceError {
    /// Nothing says where states of this user lie.
    #[error(
        "neither STATE_DIRECTORY, XDG_STATE_HOME nor HOME is an absolute path: name a directory, [state] directory"
    )]
    Nowhere,
    /// The directory cannot be made or used.
    #[error("{}: {source}", path.display())]
    Unusable {
        /// The directory.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// Others may write into the usual directory.
    #[error("{}: users other than its owner may write into it: chmod 700 it", path.display())]
    Open {
        /// The directory.
        path: PathBuf,
    },
}

/// Returns the directory to keep states in, made where it is not there: the one that the configuration names,
/// else the usual one, which is closed to other users.
///
/// # Errors
///
/// If there is no folder, or it cannot be used.
pub fn prepare(named: Option<&Path>) -> Result<PathBuf, PlaceError> {
    if let Some(path) = named {
        return usable(path.to_owned());
    }
    let path = usual(|name| std::env::var_os(name)).ok_or(PlaceError::Nowhere)?;
    let made = DirBuilder::new().recursive(true).mode(0o700).create(&path);
    let rights = made.and_then(|()| std::fs::metadata(&path));
    match rights {
        Err(source) => Err(PlaceError::Unusable { path, source }),
        Ok(rights) if rights.mode() & 0o022 != 0 => Err(PlaceError::Open { path }),
        Ok(_) => usable(path),
    }
}

fn usable(path: PathBuf) -> Result<PathBuf, PlaceError> {
    match access(&path, Access::WRITE_OK | Access::EXEC_OK) {
        Ok(()) => Ok(path),
        Err(error) => Err(PlaceError::Unusable { path, source: error.into() }),
    }
}

/// systemd's directory of the service, else the user's for states.
fn usual(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    let absolute = |path: PathBuf| path.is_absolute().then_some(path);
    let service = variable("STATE_DIRECTORY").and_then(|all| {
        // Several are separated by colons.
        absolute(all.to_string_lossy().split(':').next()?.into())
    });
    let user = || absolute(variable("XDG_STATE_HOME")?.into()).map(|it| it.join("dynocar"));
    let home = || absolute(variable("HOME")?.into()).map(|it| it.join(".local/state/dynocar"));
    service.or_else(user).or_else(home)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn a_service_has_its_own_directory_and_a_user_that_of_the_desktop_standard() {
        let usual = |variables: &[(&str, &str)]| {
            let found = |name: &str| variables.iter().find(|it| it.0 == name).map(|it| it.1.into());
            usual(found).map(|path| path.display().to_string())
        };
        let home = ("HOME", "/home/me");
        let service = ("STATE_DIRECTORY", "/var/lib/dynocar:/var/lib/other");
        let user = ("XDG_STATE_HOME", "/states");
        assert_eq!(usual(&[home, user, service]).as_deref(), Some("/var/lib/dynocar"));
        assert_eq!(usual(&[home, user]).as_deref(), Some("/states/dynocar"));
        assert_eq!(usual(&[home]).as_deref(), Some("/home/me/.local/state/dynocar"));
        let wrong = ("XDG_STATE_HOME", "states");
        assert_eq!(usual(&[home, wrong]).as_deref(), Some("/home/me/.local/state/dynocar"));
        assert_eq!(usual(&[wrong, ("STATE_DIRECTORY", "")]), None);
    }

    #[test]
    fn a_directory_that_is_named_is_not_made() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(prepare(Some(folder.path())).unwrap(), folder.path());
        let error = prepare(Some(&folder.path().join("none"))).unwrap_err();
        assert!(error.to_string().contains("No such file"), "{error}");
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        std::fs::set_permissions(&file, PermissionsExt::from_mode(0o600)).unwrap();
        assert!(matches!(prepare(Some(&file)), Err(PlaceError::Unusable { .. })));
    }
}
