//! Why a Parquet file is none that can be read.

use dynocar_recording::error::AtPath;
use dynocar_recording::error::ReadProblem;

/// Why a Parquet file, or a folder of them, cannot be read.
pub type TableError = AtPath<TableProblem>;

/// What is wrong with a Parquet file.
#[derive(Debug, thiserror::Error)]
pub enum TableProblem {
    /// The system does not give it.
    #[error(transparent)]
    Unreadable(#[from] std::io::Error),
    /// It is of another format, or broken.
    #[error("not a Parquet file that can be read: {0}")]
    NotParquet(String),
    /// It is Parquet of somebody else.
    #[error(
        "not a recording: expected Parquet that `dynocar convert` has written; other Parquet files are \
         the runs of a dataset, named in its dataset.toml"
    )]
    NotOurs,
    /// A column is not there.
    #[error("no column {column}: expected one of {expected}")]
    NoColumn {
        /// Its name.
        column: String,
        /// Its type.
        expected: String,
    },
    /// A column holds something else.
    #[error("column {column}: expected {expected}, found {found}")]
    OtherType {
        /// The column.
        column: String,
        /// What was expected.
        expected: String,
        /// What it holds.
        found: String,
    },
    /// A value is missing that never is.
    #[error("column {column}, row {row}: expected a value, found none")]
    NoValue {
        /// The column.
        column: String,
        /// The row, counted from 1.
        row: usize,
    },
    /// What it holds is no recording that can be read.
    #[error(transparent)]
    Recording(#[from] ReadProblem),
}

impl TableProblem {
    /// A file that is none that can be read.
    pub fn not_parquet(problem: impl std::fmt::Display) -> Self {
        // What the library says is a sentence, some with its own title.
        let problem = problem.to_string();
        TableProblem::NotParquet(problem.trim_start_matches("Parquet argument error: ").to_owned())
    }
}
