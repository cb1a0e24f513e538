//! One line of the comparison.

use serde::Serialize;

use super::seeds::Seeds;

/// Xia 2023.
pub const XIA: &str = "Xia 2023";
/// Wang 2022.
pub const WANG: &str = "Wang 2022";

/// A figure of a paper, measured here with the paper's method, its baseline and ours.
///
/// Errors are in `unit`; a method that a table does not have is `None`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
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
        let (quantity, seeds) = (quantity.into(), seeds.count);
        Row { paper, table, quantity, unit, seeds, ..Row::default() }
    }
}
