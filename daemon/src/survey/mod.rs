//! Raw recordings to a dataset on a surveyed line: reading, writing and telling.
//!
//! - [`read`]: a dataset's runs as recordings; a line that was surveyed before
//! - [`write`](mod@write): the dataset folder with its trips
//! - [`answer`]: the result for machines
//! - [`page`]: the result as a page

pub mod answer;
pub mod page;
pub mod read;
pub mod write;

use std::path::PathBuf;

use dynocar_core::survey::SurveyError;

use crate::dataset::LoadError;

/// Why a survey comes to no dataset.
#[derive(Debug, thiserror::Error)]
pub enum SurveyFailure {
    /// The dataset or the line cannot be read.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// Nothing can be surveyed in it.
    #[error(transparent)]
    Survey(#[from] SurveyError),
    /// A line's file lacks what a map needs, or its alignment cannot be read.
    #[error("{}: {problem}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// What was expected and what came.
        problem: String,
    },
    /// A file cannot be written.
    #[error("{}: cannot be written: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}
