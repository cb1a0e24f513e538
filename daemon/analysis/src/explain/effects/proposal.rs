//! What a kind of effect makes of the data at hand.

use std::sync::Arc;

use dynocar_model::terms::Parameter;
use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::EffectKind;

use crate::explain::hypothesis::{Hypothesis, ReportContext, Reported, SharedHypothesis};
use crate::explain::scan::Scan;

/// A hypothesis with values to start the fit from.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The structure.
    pub hypothesis: SharedHypothesis,
    /// Values of its parameters.
    pub start: Vec<f64>,
}

impl Candidate {
    /// A candidate from a hypothesis.
    pub fn new(hypothesis: impl Hypothesis + 'static, start: Vec<f64>) -> Self {
        Candidate { hypothesis: Arc::new(hypothesis), start }
    }

    /// Whether it has ends, runs or a course along the line, of which there are many.
    pub fn is_chosen_among_many(&self) -> bool {
        let of = &self.hypothesis;
        !of.ends().is_empty() || of.is_event() || of.is_gradient()
    }

    /// Whether its structure is the only one, whatever is left to explain.
    pub fn is_fixed(&self) -> bool {
        !self.is_chosen_among_many() && self.hypothesis.choice_cost() == 0.0
    }

    /// The structure, and no effect where a fit comes to its values in one step: it is linear in them.
    pub fn from_none(self) -> (SharedHypothesis, Vec<f64>) {
        let effect = &self.hypothesis;
        let is_linear = effect.is_gradient() || effect.only_resists() && self.start.len() == 1;
        let start = if is_linear { vec![effect.none(); self.start.len()] } else { self.start };
        (self.hypothesis, start)
    }

    /// The structure and the values.
    pub fn parts(self) -> (SharedHypothesis, Vec<f64>) {
        (self.hypothesis, self.start)
    }
}

/// What a kind makes of the data.
#[derive(Clone, Debug)]
pub enum Proposal {
    /// Structures worth a fit.
    Candidates(Vec<Candidate>),
    /// The data do not allow to test it: why.
    NotTestable(String),
}

impl Proposal {
    /// The first structure, where there is one.
    pub fn first(self) -> Option<Candidate> {
        match self {
            Proposal::Candidates(candidates) => candidates.into_iter().next(),
            Proposal::NotTestable(_) => None,
        }
    }
}

/// Delay and lag in s near none: where a fit begins whose other starts are all worse than none.
const NEAR_NONE_S: [f64; 2] = [0.05, 0.05];

/// The delay and lag in s that a fit begins from: of some starts the one that explains most, given by how much each
/// decreases the cost.
pub fn late_from(starts_s: &[[f64; 2]], decrease: impl Fn([f64; 2]) -> f64) -> Vec<f64> {
    let each = starts_s.iter().map(|start_s| (decrease(*start_s), *start_s));
    let best = each.max_by(|one, other| one.0.total_cmp(&other.0));
    best.filter(|(decrease, _)| *decrease > 0.0).map_or(NEAR_NONE_S, |(_, start_s)| start_s).into()
}

/// Standard deviation in s of a dead time and of a lag by the sampling step. Between samples forces are taken to change
/// evenly, so that each of the two may be off by any part of a step; their sum is known better.
pub fn late_by_sampling_s(step_s: f64) -> f64 {
    step_s / 12_f64.sqrt()
}

/// A dead time and a lag, each with its standard deviation: neither is less than none nor more than both together,
/// however little the data distinguish one from the other.
pub fn late_reported(context: &ReportContext, parameters: &[Parameter]) -> Reported {
    let most_s = context.parameters.iter().sum::<f64>() + HALF_95 * context.deviation_of_sum();
    let mut reported = Reported::default();
    for (parameter, (&value_s, &std_s)) in
        parameters.iter().zip(context.parameters.iter().zip(context.deviations))
    {
        let widest_s = value_s.max(most_s - value_s) / HALF_95;
        reported.push(parameter.name, value_s, std_s.min(widest_s));
    }
    reported
}

/// A kind of effect.
pub trait Effect: Send + Sync {
    /// Its name.
    fn kind(&self) -> EffectKind;

    /// Structures for the data at hand, given what the current model leaves.
    fn propose(&self, scan: &Scan) -> Proposal;

    /// The kind as one number of the whole train or line, with no place or run chosen; `None` where it
    /// is none, and where the data do not allow to test it.
    fn whole(&self, _scan: &Scan) -> Option<Candidate> {
        None
    }
}

#[cfg(test)]
mod tests {
    use dynocar_model::terms::delay;
    use nalgebra::DMatrix;

    use super::*;
    use crate::explain::answer::ParameterValue;

    #[test]
    fn neither_a_dead_time_nor_a_lag_is_more_than_both_or_less_than_none() {
        // The sum of the two is known to 0.1 s, either to 2 s.
        let covariance = DMatrix::from_row_slice(2, 2, &[4.0, -3.995, -3.995, 4.0]);
        let context = ReportContext {
            parameters: &[0.2, 0.1],
            deviations: &[2.0, 2.0],
            c: 0.0,
            c_deviation: 0.0,
            covariance: &covariance,
            first: 0,
            weight_kn: 1.0,
            few_runs_factor: 1.0,
        };
        let reported = late_reported(&context, &delay::PARAMETERS);
        let std_s = |name: &str| match reported.deviations[name] {
            ParameterValue::Number(std_s) => std_s,
            _ => panic!("{name} is a number"),
        };
        let most_s = 0.3 + HALF_95 * 0.1;
        assert!((std_s("delay_s") - (most_s - 0.2) / HALF_95).abs() < 1e-9);
        assert!((std_s("lag_s") - (most_s - 0.1) / HALF_95).abs() < 1e-9);
    }
}
