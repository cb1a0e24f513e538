//! Contents of the report of an explanation, as numbers and words, without page or drawing.
//!
//! # Layout, in the order of the page
//!
//! - [`sentence`]: the verdict in a plain sentence, and other explanations
//! - [`effect`]: an effect in words
//! - [`errors`]: open-loop errors before and after, with bootstrap intervals
//! - [`windows`], [`covariates`], [`panels`]: the residual as a force, window by window, against
//!   covariates
//! - [`residual_line`]: the residual along the line, by direction, with the places found
//! - [`timeline`]: the explanation as events and series in time, speeds of runs
//! - [`parameters`]: fitted values, with uncertainty
//!
//! The quality of a run's data is in the dataset itself ([`RunQuality`](crate::dataset::RunQuality)) and in
//! [`RunData`](super::evidence::RunData).

pub mod covariates;
pub mod effect;
pub mod errors;
pub mod panels;
pub mod parameters;
pub mod residual_line;
pub mod sentence;
pub mod timeline;
pub mod windows;

use super::Explanation;
use crate::dataset::Dataset;
use errors::Errors;
use panels::Panel;
pub use parameters::IntervalEstimate;
use parameters::{ParameterRow, PlaceTable};
use residual_line::AlongLine;
use sentence::CandidateRow;
use timeline::Trace;

/// Everything that a report shows beyond the answer and the dataset's own account.
#[derive(Clone, Debug, PartialEq)]
pub struct ReportData {
    /// The verdict in a plain sentence or two.
    pub sentence: String,
    /// Errors before and after.
    pub errors: Errors,
    /// Speeds of some runs.
    pub traces: Vec<Trace>,
    /// The residual against covariates, the one that matters most first.
    pub panels: Vec<Panel>,
    /// The residual and the places found along the line.
    pub line: AlongLine,
    /// Base resistance and effects.
    pub parameters: Vec<ParameterRow>,
    /// Where the effects act.
    pub places: PlaceTable,
    /// Every kind of the library.
    pub candidates: Vec<CandidateRow>,
}

impl ReportData {
    /// Returns the contents of the report of this explanation of a dataset.
    pub fn new(dataset: &Dataset, explanation: &Explanation) -> Self {
        let errors = Errors::from_explanation(explanation);
        let windows = windows::windows(explanation);
        ReportData {
            sentence: sentence::sentence(&explanation.answer, &errors),
            traces: timeline::traces(explanation),
            panels: panels::panels(dataset, explanation, &windows),
            line: AlongLine::new(explanation, &windows),
            parameters: parameters::rows(dataset, explanation),
            places: PlaceTable::from_explanation(explanation),
            candidates: sentence::candidate_rows(explanation),
            errors,
        }
    }
}
