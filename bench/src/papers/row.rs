//! One line of the comparison, and the runs behind it.

use std::ops::Range;

/// Xia 2023.
pub const XIA: &str = "Xia 2023";
/// Wang 2022.
pub const WANG: &str = "Wang 2022";

/// A figure of a paper, measured here with the paper's method, its baseline and ours.
///
/// Errors are in `unit`; a method that a table does not have is `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PaperRow {
    /// Short name of the paper, as `Xia 2023`.
    pub paper: &'static str,
    /// Table or figure of the paper.
    pub table: &'static str,
    /// Measured quantity, in words.
    pub quantity: String,
    /// Note that a reader of the row needs.
    pub note: String,
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

impl PaperRow {
    /// Returns a row without figures.
    pub fn new(
        paper: &'static str,
        table: &'static str,
        quantity: impl Into<String>,
        unit: &'static str,
        seeds: Seeds,
    ) -> Self {
        let (quantity, seeds) = (quantity.into(), seeds.count);
        PaperRow { paper, table, quantity, unit, seeds, ..PaperRow::default() }
    }

    /// With a note.
    #[must_use]
    pub fn noted(self, note: impl Into<String>) -> Self {
        PaperRow { note: note.into(), ..self }
    }
}

/// Runs by their seeds, one after the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seeds {
    /// The first seed.
    pub first: u64,
    /// How many runs.
    pub count: usize,
}

impl Seeds {
    /// Returns `count` runs from seed 0 on.
    pub fn from_zero(count: usize) -> Self {
        Seeds { first: 0, count }
    }

    /// Returns the seeds.
    pub fn range(self) -> Range<u64> {
        self.first..self.first + self.count as u64
    }

    /// Returns the first of them, at most `count`.
    #[must_use]
    pub fn at_most(self, count: usize) -> Self {
        Seeds { count: self.count.min(count), ..self }
    }

    /// Returns `runs` seeds for each; other seeds than those of other first seeds.
    #[must_use]
    pub fn each(self, runs: usize) -> Self {
        Seeds { first: self.first * runs as u64, count: self.count * runs }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_that_follow_each_other_share_no_seed() {
        let (one, next) = (Seeds::from_zero(200), Seeds { first: 200, count: 200 });
        assert_eq!(one.range().end, next.range().start);
        assert_eq!(one.each(5).range().end, next.each(5).range().start);
        assert_eq!(next.at_most(20).range(), 200..220);
    }
}
