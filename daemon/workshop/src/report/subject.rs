//! What a page is about, and why it cannot be made.

use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::report::ReportData;

use super::plots::PlotError;
use super::provenance::Provenance;

/// Why a page cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A plot cannot be drawn.
    #[error("the plot of {plot} cannot be drawn: {source}")]
    Plot {
        /// What it shows.
        plot: String,
        /// Why.
        source: PlotError,
    },
}

/// Everything that the page is about.
pub struct Subject<'a> {
    /// The dataset.
    pub dataset: &'a Dataset,
    /// What was made of it.
    pub explanation: &'a Explanation,
    /// The same as numbers and words for the page.
    pub data: ReportData,
    /// Where it comes from.
    pub provenance: Provenance,
}

impl Subject<'_> {
    /// True when an effect was added to the model, so that there is an 'after'.
    pub fn has_effect(&self) -> bool {
        !self.explanation.answer.effects.is_empty()
    }

    /// Number of a run in the dataset, from 1; 0 for one that is not there.
    pub fn number(&self, file: &str) -> usize {
        let runs = &self.dataset.runs;
        runs.iter().find(|run| run.file == file).map_or(0, |run| run.number as usize)
    }
}
