//! Recordings as datasets: unpacked into a folder for as long as it is needed, by the program that
//! knows their format.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tempfile::TempDir;

use crate::output::tell;
use crate::programs::{RECORDING, call, not_started};

/// How a recording's name ends.
const EXTENSION: &str = "mcap";

/// True for the name of a recording.
pub fn is_recording(path: &Path) -> bool {
    path.extension().is_some_and(|it| it == EXTENSION) && path.is_file()
}

/// Why a recording is not unpacked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UnpackError {
    /// It holds no dataset that can be read.
    #[error("{problem}")]
    Content {
        /// The recording.
        path: PathBuf,
        /// What the program says; it names the file.
        problem: String,
    },
    /// It cannot be done, whatever it holds.
    #[error("{}: {problem}", path.display())]
    Failed {
        /// The recording.
        path: PathBuf,
        /// Why not.
        problem: String,
    },
}

/// A recording that is unpacked; the folder goes with the last copy of this.
#[derive(Clone, Debug)]
pub struct Unpacked {
    recording: PathBuf,
    folder: Arc<TempDir>,
}

impl Unpacked {
    /// Unpacks a recording; what the program remarks on is told.
    ///
    /// # Errors
    ///
    /// See [`UnpackError`].
    pub fn of(recording: &Path) -> Result<Self, UnpackError> {
        let path = recording.to_path_buf();
        let failed = |problem| UnpackError::Failed { path: path.clone(), problem };
        let folder = TempDir::with_prefix("dynocar-").map_err(|it| failed(it.to_string()))?;
        let unpacked = Unpacked { recording: path.clone(), folder: folder.into() };
        let output = call(RECORDING)
            .args(["convert", "--quiet", "-o"])
            .arg(unpacked.folder())
            .arg(recording)
            .output()
            .map_err(|error| failed(not_started(RECORDING, &error)))?;
        let words = String::from_utf8_lossy(&output.stderr).trim().to_owned();
        let problem = words.strip_prefix("dynocar: ").unwrap_or(&words).to_owned();
        match output.status.code() {
            Some(0) if words.is_empty() => Ok(unpacked),
            Some(0) => {
                tell(&words);
                Ok(unpacked)
            }
            Some(2) => Err(UnpackError::Content { path, problem }),
            _ => Err(failed(problem)),
        }
    }

    /// The dataset's folder.
    pub fn folder(&self) -> PathBuf {
        self.folder.path().join("dataset")
    }

    /// The recording.
    pub fn recording(&self) -> &Path {
        &self.recording
    }
}
