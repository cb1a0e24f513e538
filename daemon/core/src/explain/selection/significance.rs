//! When an effect is more than chance.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::explain::effects::LIBRARY;
use crate::explain::evidence::{Fit, SharedHypothesis};

/// Evidence that an effect must have: decrease of -2 log likelihood beyond the penalty.
pub const ACCEPT: f64 = 14.0;

/// Price of an effect in -2 log likelihood: each parameter costs the logarithm of the number of
/// observations (Schwarz 1978), each choice of a structure twice the logarithm of the number of
/// structures.
pub fn penalty(hypothesis: &SharedHypothesis, observations: usize) -> f64 {
    let parameters = hypothesis.parameters().len() as f64;
    parameters * (observations.max(2) as f64).ln() + hypothesis.choice_cost()
}

/// The price of all effects of a model.
pub fn model_penalty(fit: &Fit) -> f64 {
    let observations = fit.observations();
    fit.model.effects.iter().map(|effect| penalty(effect, observations)).sum()
}

/// Probability that the search over the whole library finds a decrease like this where nothing
/// acts: the tail of chi squared times the number of kinds and structures (Bonferroni).
pub fn p_value(decrease: f64, hypothesis: &SharedHypothesis) -> f64 {
    let freedom = hypothesis.parameters().len() as f64;
    let structures = (0.5 * hypothesis.choice_cost()).exp() * LIBRARY.len() as f64;
    let Ok(distribution) = ChiSquared::new(freedom) else { return 1.0 };
    (structures * distribution.sf(decrease.max(0.0))).min(1.0)
}
