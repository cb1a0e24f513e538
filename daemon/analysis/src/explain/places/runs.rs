//! A force found at some places, and the runs in which it acts.

use super::site::{Intervals, Site};
use crate::explain::evidence::EQUAL;
use crate::explain::scan::{Scan, Tuple};
use crate::statistics::greatest_first;

/// A set of intervals and runs with the gain of a common factor on the shape there.
#[derive(Clone, Debug)]
pub struct FoundIntervals {
    /// Disjoint intervals in m, by chainage.
    pub intervals_m: Vec<[f64; 2]>,
    /// The chainage in m over which the runs move.
    pub span_m: [f64; 2],
    /// Indices of the fit runs; `None` for all runs that pass.
    pub runs: Option<Vec<usize>>,
    /// Decrease of the cost.
    pub gain: f64,
    /// The factor.
    pub estimate: f64,
    /// Twice the logarithm of the number of structures this was chosen from.
    pub choice_cost: f64,
    /// Standard deviation of the factor by the error of the gradient map, which all passes share.
    pub map_error: f64,
}

impl FoundIntervals {
    /// Returns its site.
    pub fn site(&self, scan: &Scan) -> Site {
        let FoundIntervals { span_m, choice_cost, map_error, .. } = *self;
        let intervals_m = self.intervals_m.clone();
        let file = |&index: &usize| scan.problem.runs[index].file.clone();
        let runs = self.runs.as_ref().map(|runs| runs.iter().map(file).collect());
        let sections = (!intervals_m.is_empty()).then_some(Intervals { intervals_m, span_m });
        Site { sections, runs, choice_cost, map_error }
    }
}

/// The runs, as a set of numbers, whose common positive factor explains most after the cost of choosing.
pub(super) fn best_runs(
    scan: &Scan,
    tuples: &[Tuple],
    runs_min: usize,
) -> (Option<Vec<usize>>, f64, f64, f64) {
    let mut order: Vec<(usize, f64, f64)> = tuples
        .iter()
        .enumerate()
        .filter(|(_, tuple)| tuple.square > 0.0)
        .map(|(index, tuple)| {
            let (gain, estimate) = scan.gain(tuple);
            (index, gain, estimate)
        })
        .collect();
    greatest_first(&mut order, |it| it.1);
    let passing = order.len();
    let mut best = (None, 0.0, 0.0, 0.0);
    if passing < runs_min {
        return best;
    }
    let mut sum = Tuple::zero(scan.fit.theta.len());
    let mut chosen = Vec::new();
    // A chosen run shows the force by itself.
    let alone = order.iter().filter(|(_, gain, estimate)| *gain > EQUAL && *estimate > 0.0);
    for &(index, ..) in alone {
        sum.add(&tuples[index]);
        chosen.push(index);
        let (gain, estimate) = scan.gain(&sum);
        let cost = subset_cost(passing, chosen.len());
        let is_set = chosen.len() >= runs_min && chosen.len() < passing;
        if is_set && estimate > 0.0 && gain - cost > best.1 - best.3 {
            let mut runs = chosen.clone();
            runs.sort_unstable();
            best = (Some(runs), gain, estimate, cost);
        }
    }
    let mut all = Tuple::zero(scan.fit.theta.len());
    order.iter().for_each(|&(index, _, _)| all.add(&tuples[index]));
    let (gain, estimate) = scan.gain(&all);
    if estimate > 0.0 && gain > best.1 - best.3 {
        best = (None, gain, estimate, 0.0);
    }
    best
}

/// The runs in which a common positive factor on a shape explains most, wherever they are.
pub fn best_of_runs(scan: &Scan, tuples: &[Tuple]) -> FoundIntervals {
    let (runs, gain, estimate, choice_cost) = best_runs(scan, tuples, 1);
    FoundIntervals {
        intervals_m: Vec::new(),
        span_m: [0.0; 2],
        runs,
        gain,
        estimate,
        choice_cost,
        map_error: 0.0,
    }
}

/// Twice the logarithm of the number of choices of `taken` of `count` runs.
pub fn subset_cost(count: usize, taken: usize) -> f64 {
    let ln_choices: f64 =
        (0..taken).map(|k| ((count - k) as f64 / (k + 1) as f64).ln()).sum::<f64>();
    2.0 * (ln_choices + (count.max(1) as f64).ln())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choosing_all_or_none_of_the_runs_costs_less_than_choosing_half() {
        assert!(subset_cost(8, 4) > subset_cost(8, 1));
        assert!((subset_cost(8, 4) - 2.0 * (70f64.ln() + 8f64.ln())).abs() < 1e-9);
    }
}
