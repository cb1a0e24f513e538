//! Why a survey comes to no dataset.

use std::path::PathBuf;

use dynocar_analysis::survey::SurveyError;

use dynocar::dataset::LoadError;
use dynocar::output::OutputError;

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
    SurveyedLine {
        /// The file.
        path: PathBuf,
        /// What was expected and what came.
        problem: String,
    },
    /// A file cannot be written, or would cost data.
    #[error(transparent)]
    Output(#[from] OutputError),
}
