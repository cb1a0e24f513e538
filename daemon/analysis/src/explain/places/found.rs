//! Where and in which runs a force was found.

use super::ends::Intervals;
use crate::explain::scan::Scan;

/// A set of intervals and runs with what a common factor on the shape there explains.
#[derive(Clone, Debug)]
pub struct Found {
    /// Disjoint intervals in m, by chainage.
    pub intervals_m: Vec<[f64; 2]>,
    /// The chainage in m over which the runs move.
    pub span_m: [f64; 2],
    /// Fit runs by number; `None` for all that pass.
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

impl Found {
    /// Its intervals, as ends that were estimated.
    pub fn sections(&self) -> Intervals {
        Intervals { intervals_m: self.intervals_m.clone(), span_m: self.span_m }
    }

    /// Files of its runs; `None` for all.
    pub fn files(&self, scan: &Scan) -> Option<Vec<String>> {
        let file = |&index: &usize| scan.problem.runs[index].file.clone();
        self.runs.as_ref().map(|runs| runs.iter().map(file).collect())
    }
}
