//! Sections of the report's page, and their subject: a dataset and its explanation.

pub mod errors;
pub mod model;
pub mod quality;
pub mod residual;

use dynocar_analysis::dataset::{Dataset, Role, Run};
use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::report::ReportData;
use dynocar_analysis::explain::report::errors::RunErrors;

/// A section of the page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PageSection {
    /// Its anchor.
    pub id: &'static str,
    /// Its heading.
    pub title: &'static str,
    /// Its HTML.
    pub body: String,
}

/// A dataset and its explanation, as the page shows them.
pub struct Subject<'a> {
    /// The dataset.
    pub dataset: &'a Dataset,
    /// Explanation of the dataset.
    pub explanation: &'a Explanation,
    /// The explanation as numbers and words for the page.
    pub data: ReportData,
}

impl<'a> Subject<'a> {
    /// Returns the subject for an explanation of a dataset.
    pub fn new(dataset: &'a Dataset, explanation: &'a Explanation) -> Self {
        Subject { dataset, explanation, data: ReportData::new(dataset, explanation) }
    }

    /// Returns whether an effect was added to the model, so that there are values 'after' it.
    pub fn has_effect(&self) -> bool {
        !self.explanation.answer.effects.is_empty()
    }

    /// Returns the name of the model without effects in a key.
    pub fn before(&self) -> &'static str {
        if self.has_effect() { "before" } else { "declared model, a, b, c refitted" }
    }

    /// Returns the run of a file.
    pub fn run(&self, file: &str) -> Option<&'a Run> {
        self.dataset.runs.iter().find(|run| run.file == file)
    }

    /// Returns the number of a run in the dataset, from 1; 0 for one that is not there.
    pub fn number(&self, file: &str) -> usize {
        self.run(file).map_or(0, |run| run.number as usize)
    }

    /// Returns the errors of the runs of a role, with their numbers.
    pub fn errors_of(&self, role: Role) -> Vec<(usize, &RunErrors)> {
        let own = self.data.errors.by_run.iter().filter(|run| run.role == role);
        own.map(|run| (self.number(&run.file), run)).collect()
    }
}
