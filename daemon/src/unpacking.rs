//! Recordings in Parquet as datasets: unpacked into a folder for as long as it is needed, by the program that
//! knows the format; and Parquet files of a dataset as columns of numbers.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use dynocar_dataset::train_rows::TrainRows;
use dynocar_dataset::{ColumnMapping, RunColumns};
use dynocar_shared::TrainId;
use tempfile::TempDir;

use crate::columns_stream;
use crate::output::report_line;
use crate::programs::{CallFailure, PARQUET, RECORDING, call, taken_of};

/// True for the name of a file, or a folder of files, of Parquet.
pub fn is_parquet(path: &Path) -> bool {
    path.extension().is_some_and(|it| it == "parquet")
}

/// True for the name of a recording in Parquet.
pub fn is_parquet_recording(path: &Path) -> bool {
    is_parquet(path) && path.exists()
}

/// The program that carries out a command with these words: that of recordings, unless one of them is
/// the name of a recording in Parquet.
pub fn program_for<'w>(words: impl IntoIterator<Item = &'w OsStr>) -> &'static str {
    if words.into_iter().any(|it| is_parquet(Path::new(it))) { PARQUET } else { RECORDING }
}

/// All columns of a Parquet file, with what the mapped ones hold, and whose the rows are where that is asked for.
///
/// # Errors
///
/// In words, without the file's name.
pub fn columns_of(
    file: &Path,
    mappings: &[ColumnMapping],
    train_rows: &TrainRows,
) -> Result<RunColumns, String> {
    let mut command = call(PARQUET);
    command.arg("columns").arg(file);
    match train_rows {
        TrainRows::Unsaid => command.arg("--trains"),
        TrainRows::Of { column, .. } => command.arg(format!("--trains={column}")),
        TrainRows::All => &mut command,
    };
    for it in mappings {
        for name in it.names() {
            command.arg("--column").arg(name).arg(it.unit.name());
        }
    }
    let columns = taken_of(PARQUET, &mut command, |it| columns_stream::read(it));
    let (columns, _) = columns.map_err(CallFailure::words)?;
    columns.ok_or_else(|| format!("{PARQUET}: hands over no columns"))
}

/// Why a recording is not unpacked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UnpackError {
    /// It holds no dataset that can be read.
    #[error("{problem}")]
    Content {
        /// The recording.
        path: PathBuf,
        /// Message of the program; it names the file.
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

/// Unpacks what a recording holds of a train into a new folder.
fn unpack(recording: &Path, folder: &Path, train: Option<TrainId>) -> Result<(), UnpackError> {
    let path = recording.to_path_buf();
    let mut command = call(PARQUET);
    command.args(["convert", "--quiet", "-o"]).arg(folder);
    if let Some(train) = train {
        command.arg("--train").arg(train.0.to_string());
    }
    command.arg(recording);
    let ((), words) = taken_of(PARQUET, &mut command, |_| ()).map_err(|failure| match failure {
        CallFailure::Input(problem) => UnpackError::Content { path: path.clone(), problem },
        CallFailure::Work(problem) => UnpackError::Failed { path: path.clone(), problem },
    })?;
    if !words.is_empty() {
        report_line(&words);
    }
    Ok(())
}

/// A recording that is unpacked; the folder goes with the last copy of this.
#[derive(Clone, Debug)]
pub struct Unpacked {
    recording: PathBuf,
    folder: Arc<TempDir>,
}

impl Unpacked {
    /// Unpacks what a recording holds of a train, its only one where none is named; what the program diagnoses is
    /// reported.
    ///
    /// # Errors
    ///
    /// See [`UnpackError`].
    pub fn of(recording: &Path, train: Option<TrainId>) -> Result<Self, UnpackError> {
        let path = recording.to_path_buf();
        let folder = TempDir::with_prefix("dynocar-").map_err(|error| UnpackError::Failed {
            path: path.clone(),
            problem: error.to_string(),
        })?;
        let unpacked = Unpacked { recording: path, folder: folder.into() };
        unpack(recording, &unpacked.folder(), train)?;
        Ok(unpacked)
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
