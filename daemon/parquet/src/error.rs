//! Reasons why a Parquet file cannot be read.
//!
//! The library that reads Parquet takes some of a file's numbers for granted, and panics where a damaged file has
//! others. For us that is an error of the file like any other.

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

use dynocar_mcap::error::{AtPath, ReadProblem};

/// Why a Parquet file, or a folder of them, cannot be read.
pub type ParquetFileError = AtPath<TableProblem>;

/// Errors of a Parquet file.
#[derive(Debug, thiserror::Error)]
pub enum TableProblem {
    /// The system does not give the file.
    #[error(transparent)]
    Unreadable(#[from] std::io::Error),
    /// The file is of another format, or broken.
    #[error("not a Parquet file that can be read: {0}")]
    NotParquet(String),
    /// The file is Parquet, but not written by Dynocar.
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
        /// Expected type or value.
        expected: String,
        /// Type or value in the file.
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
    /// The contents are not a readable recording.
    #[error(transparent)]
    Recording(#[from] ReadProblem),
}

impl TableProblem {
    /// Returns the error of a file that is not readable Parquet.
    pub fn not_parquet(problem: impl std::fmt::Display) -> Self {
        // The library's message is a sentence, some with its own title.
        let problem = problem.to_string();
        TableProblem::NotParquet(problem.trim_start_matches("Parquet argument error: ").to_owned())
    }
}

thread_local! {
    /// True while this thread reads a file: then a panic is no news.
    static IS_READING: Cell<bool> = const { Cell::new(false) };
}

/// Reads a file; a panic of the library is reported as an error of the file.
///
/// # Errors
///
/// As the work, and where the file makes the library panic.
pub fn guarded<T>(work: impl FnOnce() -> Result<T, TableProblem>) -> Result<T, TableProblem> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let former_hook = take_hook();
        set_hook(Box::new(move |panic| {
            if !IS_READING.get() {
                former_hook(panic);
            }
        }));
    });
    IS_READING.set(true);
    // Half-done work is dropped with the error.
    let done = catch_unwind(AssertUnwindSafe(work));
    IS_READING.set(false);
    done.unwrap_or_else(|panic| {
        Err(TableProblem::NotParquet(format!("damaged: {}", words(panic.as_ref()))))
    })
}

fn words(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("unreadable")
}
