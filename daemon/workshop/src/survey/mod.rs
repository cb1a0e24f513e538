//! From raw recordings to a dataset of trips on a surveyed line: reading, surveying or mapping, writing and reporting.
//!
//! - [`read`]: a dataset's runs as recordings; a line that was surveyed before
//! - [`write`](mod@write): the dataset folder with its trips
//! - [`answer`]: the result for machines
//! - [`page`]: the result as a page

pub mod answer;
pub mod page;
pub mod read;
pub mod write;

use std::path::{Path, PathBuf};

use crate::dataset::load;
use dynocar::dataset::DatasetSource;
use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::survey::stops::SurveyedStop;
use dynocar_analysis::survey::{Survey, survey};

use answer::SurveyAnswer;
use read::Material;
use write::write;

pub use read::SurveyFailure;

/// Distance in m below which a stop takes the name of a stop of the known line.
const SAME_STOP_M: f64 = 25.0;

/// A survey that was made and written.
pub struct Surveyed {
    /// The raw recordings.
    pub raw: Dataset,
    /// Findings of the survey.
    pub survey: Survey,
    /// The same for machines.
    pub answer: SurveyAnswer,
    /// The files of the dataset of trips.
    pub files: Vec<PathBuf>,
}

/// Surveys the raw recordings of a folder, or maps them on a line surveyed before, and writes the
/// dataset of trips.
///
/// # Errors
///
/// When the recordings or the line cannot be read, hold no line, or a file cannot be written.
pub fn survey_folder<'s>(
    source: impl Into<DatasetSource<'s>>,
    line: Option<&Path>,
    out: &Path,
) -> Result<Surveyed, SurveyFailure> {
    let source = source.into();
    let raw = load(source)?;
    let known = line.map(read::known_line).transpose()?;
    let (recordings, vehicle) = (read::recordings(&raw), read::vehicle(&raw));
    let mut survey = survey(&recordings, &vehicle, known.as_ref().map(|(known, _)| known))?;
    if let Some((_, track)) = &known {
        name_stops(&mut survey.stops, &track.survey.stops);
    }
    let material = Material { source, dataset: &raw, vehicle: &vehicle, survey: &survey, line };
    let files = write(&material, out)?;
    let answer = SurveyAnswer::new(&raw, &vehicle, &survey);
    Ok(Surveyed { raw, survey, answer, files })
}

/// Stops of a known line keep their names.
fn name_stops(stops: &mut [SurveyedStop], known: &[(f64, String)]) {
    for stop in stops {
        let away = |known: &&(f64, String)| (known.0 - stop.chainage_m).abs();
        let nearest = known.iter().min_by(|one, other| away(one).total_cmp(&away(other)));
        if let Some(nearest) = nearest.filter(|nearest| away(nearest) < SAME_STOP_M) {
            stop.name.clone_from(&nearest.1);
        }
    }
}
