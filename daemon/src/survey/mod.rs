//! Raw recordings to a dataset on a surveyed line: reading, writing and telling.
//!
//! - [`read`]: a dataset's runs as recordings; a line that was surveyed before
//! - [`write`](mod@write), [`trip_rows`]: the dataset folder with its trips
//! - [`answer`]: the result for machines
//! - [`page`]: the result as a page

pub mod answer;
pub mod material;
pub mod page;
pub mod read;
pub mod trip_rows;
pub mod write;

use std::path::{Path, PathBuf};

use dynocar_core::dataset::Dataset;
use dynocar_core::survey::stops::Stop;
use dynocar_core::survey::{Survey, SurveyError, survey};

use self::answer::Answer;
use self::material::Material;
use self::write::write;
use crate::dataset::{LoadError, load};
use crate::output::OutputError;

/// Stops nearer than this many m to one of a known line have its name.
const SAME_STOP_M: f64 = 25.0;

/// A survey that was made and written.
pub struct Surveyed {
    /// The raw recordings.
    pub raw: Dataset,
    /// What was found.
    pub survey: Survey,
    /// The same for machines.
    pub answer: Answer,
    /// The files of the dataset of trips.
    pub files: Vec<PathBuf>,
}

/// Surveys the raw recordings of a folder, or maps them on a line surveyed before, and writes the
/// dataset of trips.
///
/// # Errors
///
/// When the recordings or the line cannot be read, hold no line, or a file cannot be written.
pub fn survey_folder(
    source: &Path,
    line: Option<&Path>,
    out: &Path,
) -> Result<Surveyed, SurveyFailure> {
    let raw = load(source)?;
    let known = line.map(read::known_line).transpose()?;
    let (recordings, vehicle) = (read::recordings(&raw), read::vehicle(&raw));
    let mut survey = survey(&recordings, &vehicle, known.as_ref().map(|(known, _)| known))?;
    if let Some((_, track)) = &known {
        name_stops(&mut survey.stops, &track.survey().stops);
    }
    let material = Material { source, dataset: &raw, vehicle: &vehicle, survey: &survey, line };
    let files = write(&material, out)?;
    let answer = Answer::of(&raw, &vehicle, &survey);
    Ok(Surveyed { raw, survey, answer, files })
}

/// Stops of a known line keep their names.
fn name_stops(stops: &mut [Stop], known: &[(f64, String)]) {
    for stop in stops {
        let away = |known: &&(f64, String)| (known.0 - stop.chainage_m.value).abs();
        let nearest = known.iter().min_by(|one, other| away(one).total_cmp(&away(other)));
        if let Some(nearest) = nearest.filter(|nearest| away(nearest) < SAME_STOP_M) {
            stop.name.clone_from(&nearest.1);
        }
    }
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
    Line {
        /// The file.
        path: PathBuf,
        /// What was expected and what came.
        problem: String,
    },
    /// A file cannot be written, or would cost data.
    #[error(transparent)]
    Output(#[from] OutputError),
}
