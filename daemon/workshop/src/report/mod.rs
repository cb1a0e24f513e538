//! An explanation as one page of HTML that can be passed on: it needs no network, no font, and its only script is
//! optional.
//!
//! # Layout
//!
//! - [`mod@page`]: the page from top to bottom; the survey's and the learner's have its head and policy too; and
//!   its plots as separate files
//! - [`sections`]: the sections of the page, and their subject
//! - [`plots`]: the plots, as SVG text
//! - [`html`]: parts of pages: tables, sections, numbers
//! - [`provenance`]: command, versions, content hash
//! - `style.css`: the style, for wide and narrow, light and dark, screen and paper
//! - `plots.js`: values at the pointer and zoom

pub mod html;
pub mod page;
pub mod plots;
pub mod provenance;
pub mod sections;

use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::explain::Explanation;

use plots::PlotError;
use provenance::Provenance;
use sections::Subject;

/// How every page begins.
pub const PAGE_MARK: &str = "<!DOCTYPE html>";

/// Returns the page on an explanation of a dataset.
///
/// # Errors
///
/// When a plot cannot be drawn.
pub fn page(
    dataset: &Dataset,
    explanation: &Explanation,
    provenance: &Provenance,
) -> Result<String, PlotError> {
    page::html(&Subject::new(dataset, explanation), provenance)
}
