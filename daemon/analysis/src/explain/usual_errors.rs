//! What is usually a little wrong, beside a finished model.
//!
//! Every gradient of a map errs a little, the same in each run over it; forces are scaled and late, curve
//! constants are formulas, loads and winds differ from run to run. What the runs agree on may be that. The
//! finished model is fitted once more with all of it beside it: what the data cannot distinguish from it is
//! less sure, and what they can is surer.

use super::competing::is_in;
use super::effects::{Candidate, map_error, usual_errors};
use super::evidence::Fit;
use super::gradient_prior::SURVEYED;
use super::places::span_m;
use super::selection::{Deviations, Outcome, Search, deviations_beside};

/// Moves the effects that were found to where they fit best beside the usual errors, and a, b and c to where
/// they fit best beside the effects alone: what predicts runs knows of no usual errors. How surely the
/// parameters are known then.
pub fn given_usual_errors(search: &Search, outcome: &mut Outcome) -> Deviations {
    let (joint, shared) = joint(search, &outcome.fit);
    outcome.likeliest = outcome.fit.clone();
    let fit = &outcome.likeliest;
    let count = fit.theta.len();
    if !fit.model.effects.is_empty() {
        let theta = joint.theta[..count].to_vec();
        outcome.fit = search.problem.with_davis_fitted(&fit.model, theta, fit.noise);
    }
    deviations_beside(&joint, count, shared)
}

/// The model with the usual errors as its last effects, under what loads and winds make of the runs; how many
/// of the last parameters all runs share.
fn joint(search: &Search, fit: &Fit) -> (Fit, usize) {
    let usual = usual_errors(fit.theta[0], |kind| is_in(fit, kind));
    let shared = usual.start.len();
    let errors = map_errors(search, fit).into_iter().chain([usual]).map(Candidate::parts);
    (search.problem.with_runs_apart(&search.problem.grown(fit, errors)), shared)
}

/// The errors of the map; `None` where a gradient is fitted anyway, and where there is no map or no measured
/// position.
fn map_errors(search: &Search, fit: &Fit) -> Option<Candidate> {
    let is_fitted = fit.model.effects.iter().any(|effect| effect.is_gradient());
    if is_fitted || search.track.is_none() || search.problem.distance_ratio.is_none() {
        return None;
    }
    let span_m = span_m(&search.scan(fit)?).filter(|[low, high]| high > low)?;
    Some(map_error(span_m, SURVEYED))
}
