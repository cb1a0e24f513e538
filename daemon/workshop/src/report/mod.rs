//! An explanation as one page of HTML that can be handed on: no network, no font, and one script
//! that only adds.
//!
//! # Layout
//!
//! - [`mod@page`]: the page from top to bottom
//! - [`sections`]: its parts
//! - [`plots`]: the plots, as SVG text
//! - [`mod@images`]: the same as files of their own
//! - [`html`]: what every page has, for the survey's and the learner's too: head, policy, tables, numbers
//! - [`provenance`]: command, versions, content hash
//! - `style.css`: the style, for wide and narrow, light and dark, screen and paper
//! - `plots.js`: values at the pointer and zoom

pub mod html;
pub mod images;
pub mod page;
pub mod plots;
pub mod provenance;
pub mod sections;

use dynocar_analysis::dataset::{Dataset, Role};
use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::report::ReportData;
use dynocar_analysis::explain::report::errors::RunErrors;

use plots::PlotError;
use provenance::Provenance;

/// How every page begins.
pub const PAGE_MARK: &str = "<!DOCTYPE html>";

/// Everything that the page is about.
pub struct Subject<'a> {
    /// The dataset.
    pub dataset: &'a Dataset,
    /// What was made of it.
    pub explanation: &'a Explanation,
    /// The same as numbers and words for the page.
    pub data: ReportData,
}

impl<'a> Subject<'a> {
    /// An explanation of a dataset.
    pub fn of(dataset: &'a Dataset, explanation: &'a Explanation) -> Self {
        Subject { dataset, explanation, data: ReportData::of(dataset, explanation) }
    }

    /// True when an effect was added to the model, so that there is an 'after'.
    pub fn has_effect(&self) -> bool {
        !self.explanation.answer.effects.is_empty()
    }

    /// What the model without effects is called in a key.
    pub fn before(&self) -> &'static str {
        if self.has_effect() { "before" } else { "declared model, a, b, c refitted" }
    }

    /// Number of a run in the dataset, from 1; 0 for one that is not there.
    pub fn number(&self, file: &str) -> usize {
        let runs = &self.dataset.runs;
        runs.iter().find(|run| run.file == file).map_or(0, |run| run.number as usize)
    }

    /// The errors of the runs of a role, with their numbers.
    pub fn errors_of(&self, role: Role) -> Vec<(usize, &RunErrors)> {
        let own = self.data.errors.by_run.iter().filter(|run| run.role == role);
        own.map(|run| (self.number(&run.file), run)).collect()
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
    provenance: &Provenance,
) -> Result<String, PlotError> {
    page::html(&Subject::of(dataset, explanation), provenance)
}
