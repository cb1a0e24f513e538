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

/// The key to the colours of a plot.
pub fn legend(entries: &[(&str, &str)]) -> String {
    let items: String = entries
        .iter()
        .map(|(class, words)| format!("<li><i class=\"key {class}\"></i>{words}</li>"))
        .collect();
    format!("<ul class=\"legend\" aria-label=\"Key\">{items}</ul>\n")
}
