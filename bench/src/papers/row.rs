//! One line of the comparison, and the runs behind it: the errors of a method over the seeds, its own standard
//! deviations, and the bound.

use std::ops::Range;

use dynocar_model::train::Davis;
use dynocar_shared::HALF_95;
use nalgebra::{Matrix3, Vector3};

use crate::statistics::{mean, root_mean_square, share};

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

/// Errors, coverage and consistency of our method, with the errors of others on the same runs.
#[derive(Clone, Debug, Default)]
pub struct PaperScore {
    /// Estimate minus truth.
    pub errors: Vec<f64>,
    /// The same of the paper's method.
    pub paper: Vec<f64>,
    /// The same of the paper's baseline.
    pub baseline: Vec<f64>,
    covered: Vec<bool>,
    /// Normalised estimation error squared, per degree of freedom.
    nees: Vec<f64>,
    freedom: f64,
    /// Least standard deviation of each error, where it was reported.
    bounds: Vec<f64>,
}

impl PaperScore {
    /// Takes in a number with its claimed standard deviation.
    pub fn take(&mut self, error: f64, std: f64) {
        self.errors.push(error);
        self.covered.push(error.abs() <= HALF_95 * std);
        self.nees.push((error / std).powi(2));
        self.freedom += 1.0;
    }

    /// Takes in a resistance with the claimed covariance of a, b and c: its errors at some speeds
    /// in m/s, and that of the coefficients together.
    pub fn take_resistance(
        &mut self,
        (found, covariance): (&Davis, &Matrix3<f64>),
        truth: &Davis,
        speeds_mps: &[f64],
    ) {
        for (error, &speed_mps) in w0_errors(found, truth, speeds_mps).into_iter().zip(speeds_mps) {
            self.errors.push(error);
            self.covered.push(error.abs() <= HALF_95 * w0_std(covariance, speed_mps));
        }
        let error = Vector3::new(found.a - truth.a, found.b - truth.b, found.c - truth.c);
        if let Some(factor) = covariance.cholesky() {
            self.nees.push(error.dot(&factor.solve(&error)) / 3.0);
            self.freedom += 3.0;
        }
    }

    /// Takes in the bound of the covariance of a, b and c at some speeds in m/s.
    pub fn take_bound(&mut self, covariance: &Matrix3<f64>, speeds_mps: &[f64]) {
        self.bounds.extend(speeds_mps.iter().map(|&speed_mps| w0_std(covariance, speed_mps)));
    }

    /// Returns the mean normalised estimation error squared, per degree of freedom.
    pub fn nees(&self) -> f64 {
        mean(&self.nees)
    }

    /// Returns a row of root mean square errors, with coverage and consistency of ours; the row's own figures stay
    /// where there is none.
    pub fn row(&self, row: PaperRow) -> PaperRow {
        let rms = |of: &[f64]| (!of.is_empty()).then(|| root_mean_square(of));
        let is_judged = !self.covered.is_empty();
        PaperRow {
            paper_method: rms(&self.paper).or(row.paper_method),
            baseline: rms(&self.baseline).or(row.baseline),
            ours: rms(&self.errors),
            bound: rms(&self.bounds).or(row.bound),
            coverage: is_judged.then(|| share(self.covered.iter().copied())),
            nees: is_judged.then(|| self.nees()),
            nees_freedom: is_judged.then_some(self.freedom),
            ..row
        }
    }

    /// Returns a row of mean errors with their sign; intervals say nothing of a bias.
    pub fn bias(&self, row: PaperRow) -> PaperRow {
        PaperRow {
            paper_method: Some(mean(&self.paper)),
            baseline: Some(mean(&self.baseline)),
            ours: Some(mean(&self.errors)),
            ..row
        }
    }
}

/// Returns the errors of w0 in N/kN at some speeds in m/s.
pub fn w0_errors(found: &Davis, truth: &Davis, speeds_mps: &[f64]) -> Vec<f64> {
    speeds_mps.iter().map(|&speed| found.w0_n_per_kn(speed) - truth.w0_n_per_kn(speed)).collect()
}

/// Returns the standard deviation of w0 in N/kN at a speed in m/s.
pub fn w0_std(covariance: &Matrix3<f64>, speed_mps: f64) -> f64 {
    let powers = Vector3::new(1.0, speed_mps, speed_mps * speed_mps);
    powers.dot(&(covariance * powers)).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::papers::row::Seeds;

    #[test]
    fn ranges_that_follow_each_other_share_no_seed() {
        let (one, next) = (Seeds::from_zero(200), Seeds { first: 200, count: 200 });
        assert_eq!(one.range().end, next.range().start);
        assert_eq!(one.each(5).range().end, next.each(5).range().start);
        assert_eq!(next.at_most(20).range(), 200..220);
    }

    #[test]
    fn an_error_of_one_standard_deviation_is_covered_and_counts_one() {
        let mut score = PaperScore::default();
        score.take(0.5, 0.5);
        score.take(-3.0, 1.0);
        let row = score.row(PaperRow::new("a", "b", "c", "1", Seeds::from_zero(2)));
        assert_eq!((row.coverage, row.nees, row.nees_freedom), (Some(0.5), Some(5.0), Some(2.0)));
        assert_eq!((row.ours, row.bound), (Some(4.625_f64.sqrt()), None));
    }

    #[test]
    fn a_resistance_is_judged_at_its_speeds_and_as_a_whole() {
        let truth = Davis { a: 1.0, b: 0.0, c: 0.0 };
        let found = Davis { a: 1.3, ..truth };
        let covariance = Matrix3::from_diagonal(&Vector3::new(0.01, 1e-4, 1e-8));
        let mut score = PaperScore::default();
        score.take_resistance((&found, &covariance), &truth, &[0.0, 100.0]);
        score.take_bound(&covariance, &[0.0]);
        let row = score.row(PaperRow::new("a", "b", "c", "N/kN", Seeds::from_zero(1)));
        assert!(
            (row.ours.unwrap() - 0.3).abs() < 1e-12 && (row.bound.unwrap() - 0.1).abs() < 1e-12
        );
        assert!((row.nees.unwrap() - 3.0).abs() < 1e-9);
        assert_eq!((row.coverage, row.nees_freedom), (Some(0.5), Some(3.0)));
    }
}
