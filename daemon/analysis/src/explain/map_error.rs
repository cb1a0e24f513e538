//! What the map's own small error, the same in every passage, does to a finished model.
//!
//! Every gradient of a map is a little wrong, and each run over it errs alike: what the runs agree on may be
//! the map's. The finished model is fitted once more with that error beside it, a Gaussian process along the
//! line. What the data cannot distinguish from it is less sure, and what they can is surer.

use super::effects::map_error;
use super::evidence::Fit;
use super::gradient_prior::SURVEYED;
use super::places::span_m;
use super::selection::{Deviations, Outcome, Search, deviations};

/// Moves the models without and with the effects that were found to where they fit best beside the map's
/// error; how surely the parameters of the latter are known then. Where nothing was found they stay: a, b
/// and c alone are not known better.
pub fn given_map_error(search: &Search, outcome: &mut Outcome) -> Deviations {
    let Some(joint) = joint(search, &outcome.fit) else { return deviations(&outcome.fit) };
    let count = outcome.fit.theta.len();
    if !outcome.fit.model.effects.is_empty() {
        outcome.fit = moved(search, &outcome.fit, &joint);
        if let Some(joint) = self::joint(search, &outcome.base) {
            outcome.base = moved(search, &outcome.base, &joint);
        }
    }
    deviations(&joint).of_first(count)
}

/// A model with its parameters as they are beside the map's error.
fn moved(search: &Search, fit: &Fit, joint: &Fit) -> Fit {
    search.problem.at(&fit.model, joint.theta[..fit.theta.len()].to_vec(), fit.noise)
}

/// The model with the map's error as its last effect; `None` where a gradient is fitted anyway, and where
/// there is no map or no measured position.
fn joint(search: &Search, fit: &Fit) -> Option<Fit> {
    let is_fitted = fit.model.effects.iter().any(|effect| effect.is_gradient());
    if is_fitted || search.track.is_none() || search.problem.distance_ratio.is_none() {
        return None;
    }
    let span_m = span_m(&search.scan(fit)?).filter(|[low, high]| high > low)?;
    let error = map_error(span_m, SURVEYED);
    let theta = fit.theta.iter().chain(&error.start).copied().collect();
    Some(search.problem.fit(&fit.model.with(error.hypothesis), theta, fit.noise))
}
