//! Sections of the report's page.

pub mod errors;
pub mod model;
pub mod quality;
pub mod residual;

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
