//! The parts of the page.

pub mod candidates;
pub mod errors;
pub mod line;
pub mod parameters;
pub mod places;
pub mod quality;
pub mod reproduce;
pub mod residual;

/// A part of the page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    /// Its anchor.
    pub id: &'static str,
    /// Its heading.
    pub title: &'static str,
    /// Its HTML.
    pub body: String,
}
