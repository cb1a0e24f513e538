//! An explanation as one page of HTML that can be handed on: no network, no font, and one script
//! that only adds.
//!
//! # Layout
//!
//! - [`mod@page`]: the page from top to bottom
//! - [`mod@document`]: head, policy and foot, for the survey's page too
//! - [`sections`]: its parts
//! - [`plots`]: the plots, as SVG text
//! - [`mod@images`]: the same as files of their own
//! - [`html`]: escaping, tables, numbers
//! - [`provenance`]: command, versions, content hash
//! - `style.css`: the style, for wide and narrow, light and dark, screen and paper
//! - `plots.js`: values at the pointer and zoom

pub mod document;
pub mod html;
pub mod images;
pub mod page;
pub mod plots;
pub mod provenance;
pub mod sections;

use dynocar_core::dataset::Dataset;
use dynocar_core::explain::Explanation;
use dynocar_core::explain::report::ReportData;

use plots::PlotError;
use provenance::Provenance;

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

/// Everything that the page tells of.
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

/// The page on an explanation of a dataset.
///
/// # Errors
///
/// When a plot cannot be drawn.
pub fn page(
    dataset: &Dataset,
    explanation: &Explanation,
    provenance: Provenance,
) -> Result<String, ReportError> {
    let data = ReportData::of(dataset, explanation);
    page::html(&Subject { dataset, explanation, data, provenance })
}
