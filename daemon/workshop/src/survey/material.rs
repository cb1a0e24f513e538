//! What the files of a survey are made of.

use std::path::Path;

use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::survey::{Survey, Vehicle};

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
