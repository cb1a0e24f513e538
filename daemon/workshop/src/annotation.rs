//! An explanation beside the data that it explains, by the program that knows the format of recordings.

use std::path::{Path, PathBuf};

use dynocar_analysis::explain::report::timeline::Timeline;
use tempfile::NamedTempFile;

use dynocar::output::report_line;
use dynocar::programs::{CallFailure, RECORDING, call, output_of};

/// Why a recording is not annotated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AnnotationError {
    /// The program found something wrong with what it was given.
    #[error("{0}")]
    Input(String),
    /// It cannot be done.
    #[error("{}: {problem}", path.display())]
    Failed {
        /// The recording that was to be written.
        path: PathBuf,
        /// Why not.
        problem: String,
    },
}

/// Copies a recording, or the dataset at a path as one, into a new file with an explanation of it.
///
/// # Errors
///
/// See [`AnnotationError`].
pub fn annotate(from: &Path, timeline: &Timeline, to: &Path) -> Result<(), AnnotationError> {
    let failed = |problem: String| AnnotationError::Failed { path: to.into(), problem };
    let mut file = NamedTempFile::with_prefix("dynocar-").map_err(|it| failed(it.to_string()))?;
    serde_json::to_writer(&mut file, timeline).map_err(|it| failed(it.to_string()))?;
    let mut command = call(RECORDING);
    command.arg("annotate").arg(from).arg("--timeline").arg(file.path()).arg("--output").arg(to);
    let (_, words) = output_of(RECORDING, &mut command).map_err(|failure| match failure {
        CallFailure::Input(problem) => AnnotationError::Input(problem),
        CallFailure::Work(problem) => failed(problem),
    })?;
    report_line(&words);
    Ok(())
}
