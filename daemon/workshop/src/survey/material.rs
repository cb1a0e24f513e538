//! Material of a survey's files, and the reason where there is none.

use std::path::{Path, PathBuf};

use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::survey::{Survey, SurveyError, Vehicle};

use dynocar::dataset::{DatasetSource, LoadError};
use dynocar::output::OutputError;

/// Material of the files.
pub struct Material<'m> {
    /// Where the raw dataset lies.
    pub source: DatasetSource<'m>,
    /// The raw dataset.
    pub dataset: &'m Dataset,
    /// Declared vehicle.
    pub vehicle: &'m Vehicle,
    /// Findings of the survey.
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
        /// Expected and found contents.
        problem: String,
    },
    /// A file cannot be written, or would cost data.
    #[error(transparent)]
    Output(#[from] OutputError),
}
