//! What is usually a little wrong, beside a finished model.
//!
//! Every gradient of a map errs a little, the same in each run over it; forces are scaled and late, curve
//! constants are formulas, loads and winds differ from run to run. What the runs agree on may be that. The
//! finished model is fitted once more with all of it beside it: what the data cannot distinguish from it is
//! less sure, and what they can is surer.

use super::selection::{Deviations, Outcome, Search, deviations_beside};

/// Moves the effects that were found to where they fit best beside the usual errors, and a, b and c to where
/// they fit best beside the effects alone: what predicts runs knows of no usual errors. How surely the
/// parameters are known then, from samples so many s apart.
pub fn given_usual_errors(search: &Search, outcome: &mut Outcome, step_s: f64) -> Deviations {
    let joint = search.beside_usual_errors(outcome);
    outcome.likeliest = outcome.fit.clone();
    let fit = &outcome.likeliest;
    let count = fit.theta.len();
    if !fit.model.effects.is_empty() {
        let theta = joint.fit.theta[..count].to_vec();
        outcome.fit = search.problem.with_davis_fitted(&fit.model, theta, fit.noise);
    }
    let mut deviations = deviations_beside(&joint.fit, count, joint.shared);
    let model = &outcome.fit.model;
    for (effect, range) in model.effects.iter().zip(model.ranges()) {
        for std in &mut deviations.std[range.clone()] {
            *std = std.hypot(effect.sampling_error(step_s));
        }
    }
    deviations
}
