//! What the files of a survey are made of, and why nothing comes of it.

use std::path::{Path, PathBuf};

use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::survey::{Survey, SurveyError, Vehicle};

use dynocar::dataset::LoadError;
use dynocar::output::OutputError;

/// What the files are made of.
pub struct Material<'m> {
    /// Where the raw dataset lies.
    pub source: &'m Path,
    /// The raw dataset.
    pub dataset: &'m Dataset,
    /// What was declared of the vehicle.
    pub vehicle: &'m Vehicle,
    /// What was found.
    pub survey: &'m Survey,
    /// The line's file that was given, if any.
    pub line: Option<&'m Path>,
}

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
