//! The residual as a force, window by window.
//!
//! These forces are for the eye and not for a fit: within a window of about 20 s the slope of the difference between
//! measured and modelled speed, times the inertial mass and over the weight, is the resistance in N/kN that the model
//! lacks there (positive retards).

use crate::explain::Explanation;
use crate::explain::evidence::{Bin, Fit, RunData, UpdatedForces};
use crate::explain::selection::deviations;

/// Bins of about 2 s in a window.
const BINS: usize = 10;
/// Least number of bins of a window: a shorter rest of a segment is dropped.
const BINS_MIN: usize = 5;

/// One window of a fit run.
#[derive(Clone, Debug, PartialEq)]
pub struct FitWindow {
    /// The run, by its place among the fit runs.
    pub run: usize,
    /// First bin.
    pub first: usize,
    /// One past the last bin.
    pub end: usize,
    /// Missing resistance in N/kN without the effects.
    pub before_n_per_kn: f64,
    /// Missing resistance in N/kN with the effects.
    pub after_n_per_kn: f64,
    /// Change of the modelled resistance in N/kN per unit of each parameter of the grown model.
    pub slopes: Vec<f64>,
}

impl FitWindow {
    /// Returns the window's bins.
    pub fn bins<'r>(&self, run: &'r RunData) -> &'r [Bin] {
        &run.bins[self.first..self.end]
    }
}

/// Least-squares slope of values over the bins' times.
fn slope(bins: &[Bin], values: &[f64]) -> f64 {
    let count = bins.len() as f64;
    let mean_s = bins.iter().map(|bin| bin.time_s).sum::<f64>() / count;
    let mean = values.iter().sum::<f64>() / count;
    let (mut square, mut product) = (0.0, 0.0);
    for (bin, value) in bins.iter().zip(values) {
        let away_s = bin.time_s - mean_s;
        square += away_s * away_s;
        product += away_s * (value - mean);
    }
    if square > 0.0 { product / square } else { 0.0 }
}

/// Returns all windows of the fit runs.
pub fn windows(explanation: &Explanation) -> Vec<FitWindow> {
    let (before, after) = (&explanation.outcome.base, &explanation.outcome.fit);
    let mut windows = Vec::new();
    for (index, run) in explanation.problem.runs.iter().enumerate() {
        let columns = columns(after, run);
        for (first, end) in spans(&run.bins) {
            let force = |values: &[f64]| force_n_per_kn(run, first, end, values);
            windows.push(FitWindow {
                run: index,
                first,
                end,
                before_n_per_kn: force(&before.residuals[index]),
                after_n_per_kn: force(&after.residuals[index]),
                slopes: columns.iter().map(|column| force(column)).collect(),
            });
        }
    }
    windows
}

/// Returns a difference of speeds within a window as a resistance in N/kN.
fn force_n_per_kn(run: &RunData, first: usize, end: usize, differences: &[f64]) -> f64 {
    let own = &run.bins[first..end];
    let middle = &run.samples()[own[own.len() / 2].middle()];
    -middle.inertial_mass_kg / middle.weight_kn * slope(own, &differences[first..end])
}

/// Returns the resistance in N/kN that a model lacks, for each window of any run: first bin and the one past the
/// last, and the resistance.
pub(super) fn missing_resistance(fit: &Fit, run: &RunData) -> Vec<((usize, usize), f64)> {
    let (mut forces, mut predicted) = (UpdatedForces::default(), Vec::new());
    fit.model.predict_bins(run, &fit.theta, &mut forces, &mut predicted);
    let differences: Vec<f64> =
        run.bins.iter().zip(&predicted).map(|(bin, it)| bin.speed_mps - it).collect();
    let of = |(first, end)| ((first, end), force_n_per_kn(run, first, end, &differences));
    spans(&run.bins).into_iter().map(of).collect()
}

/// Returns the first and end of the windows; none crosses a break of motion.
fn spans(bins: &[Bin]) -> Vec<(usize, usize)> {
    let mut spans = Vec::new();
    let mut first = 0;
    while first < bins.len() {
        let mut end = first;
        while end < bins.len() && end < first + BINS && bins[end].segment == bins[first].segment {
            end += 1;
        }
        if end - first >= BINS_MIN {
            spans.push((first, end));
        }
        first = end;
    }
    spans
}

/// Change of the modelled speeds of a run's bins per unit of each parameter.
fn columns(fit: &Fit, run: &RunData) -> Vec<Vec<f64>> {
    let (mut forces, mut base, mut moved) = (UpdatedForces::default(), Vec::new(), Vec::new());
    fit.model.predict_bins(run, &fit.theta, &mut forces, &mut base);
    let deviations = deviations(fit).std;
    (0..fit.theta.len())
        .map(|i| {
            let known = Some(0.1 * deviations[i]).filter(|step| step.is_finite() && *step > 0.0);
            let step = known.unwrap_or(1e-3 * fit.theta[i].abs().max(1e-3));
            let mut theta = fit.theta.clone();
            theta[i] += step;
            fit.model.predict_bins(run, &theta, &mut forces, &mut moved);
            moved.iter().zip(&base).map(|(moved, base)| (moved - base) / step).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bins(segments: &[usize]) -> Vec<Bin> {
        let bin = |(k, &segment)| Bin {
            first: 2 * k,
            end: 2 * k + 2,
            segment,
            time_s: 2.0 * k as f64,
            speed_mps: 10.0,
            jump_mps2: 0.0,
            is_sliding: false,
        };
        segments.iter().enumerate().map(bin).collect()
    }

    #[test]
    fn windows_do_not_cross_a_stop() {
        let segments: Vec<usize> = (0..40).map(|k| usize::from(k >= 13)).collect();
        assert_eq!(spans(&bins(&segments)), [(0, 10), (13, 23), (23, 33), (33, 40)]);
    }

    #[test]
    fn the_slope_of_a_line_is_its_slope() {
        let bins = bins(&[0; 10]);
        let values: Vec<f64> = bins.iter().map(|bin| 3.0 - 0.25 * bin.time_s).collect();
        assert!((slope(&bins, &values) + 0.25).abs() < 1e-12);
    }
}
