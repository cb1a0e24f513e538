//! One line of the comparison.

use serde::Serialize;

use super::seeds::Seeds;

/// A figure of a paper, measured here with the paper's method, its baseline and ours.
///
/// Errors are in `unit`; a method that a table does not have is `None`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Short name of the paper, as `Xia 2023`.
    pub paper: &'static str,
    /// Table or figure of the paper.
    pub table: &'static str,
    /// What is measured, in words.
    pub quantity: String,
    /// Unit of the figures.
    pub unit: &'static str,
    /// The paper's own figure.
    pub published: Option<f64>,
    /// The paper's method, faithful to the corrected formulas, measured here.
    pub paper_method: Option<f64>,
    /// The paper's baseline, measured here.
    pub baseline: Option<f64>,
    /// Our method, measured here on the same runs.
    pub ours: Option<f64>,
    /// Cramér–Rao or posterior Cramér–Rao bound of the same scenario, computed here.
    pub bound: Option<f64>,
    /// Seeded runs behind the figures.
    pub seeds: usize,
    /// Share of our 95 % intervals that hold the truth, where they apply.
    pub coverage: Option<f64>,
    /// Our mean normalised estimation error squared per degree of freedom, where it applies.
    pub nees: Option<f64>,
    /// Degrees of freedom behind that mean over all runs, those of independent errors.
    pub nees_freedom: Option<f64>,
}

impl Row {
    /// A row without figures.
    pub fn new(
        paper: &'static str,
        table: &'static str,
        quantity: impl Into<String>,
        unit: &'static str,
        seeds: Seeds,
    ) -> Self {
        Row {
            paper,
            table,
            quantity: quantity.into(),
            unit,
            published: None,
            paper_method: None,
            baseline: None,
            ours: None,
            bound: None,
            seeds: seeds.count,
            coverage: None,
            nees: None,
            nees_freedom: None,
        }
    }
}
