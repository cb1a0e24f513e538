//! Why a Parquet file is none that can be read.

use std::path::{Path, PathBuf};

use dynocar_recording::reading::ReadError;

/// Why a Parquet file, or a folder of them, cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The system does not give it.
    #[error("{}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// It is of another format, or broken.
    #[error("{}: not a Parquet file that can be read: {problem}", path.display())]
    NotParquet {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// It is Parquet of somebody else.
    #[error(
        "{}: not a recording: expected Parquet that `dynocar convert` has written; other Parquet files are \
         the runs of a dataset, named in its dataset.toml", path.display()
    )]
    NotOurs {
        /// The file.
        path: PathBuf,
    },
    /// A column is not there.
    #[error("{}: no column {column}: expected one of {expected}", path.display())]
    NoColumn {
        /// The file.
        path: PathBuf,
        /// Its name.
        column: String,
        /// Its type.
        expected: String,
    },
    /// A column holds something else.
    #[error("{}: column {column}: expected {expected}, found {found}", path.display())]
    OtherType {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// What was expected.
        expected: String,
        /// What it holds.
        found: String,
    },
    /// A value is missing that never is.
    #[error("{}: column {column}, row {row}: expected a value, found none", path.display())]
    NoValue {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// The row, counted from 1.
        row: usize,
    },
    /// What it holds is no recording that can be read.
    #[error(transparent)]
    Recording(#[from] ReadError),
}

impl TableError {
    /// A file that is none that can be read.
    pub fn not_parquet(path: &Path, problem: impl std::fmt::Display) -> Self {
        // What the library says is a sentence, some with its own title.
        let problem = problem.to_string();
        let problem = problem.trim_start_matches("Parquet argument error: ").to_owned();
        TableError::NotParquet { path: path.into(), problem }
    }
}
