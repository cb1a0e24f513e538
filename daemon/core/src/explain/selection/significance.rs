//! When an effect is more than chance.

use crate::explain::evidence::{Fit, SharedHypothesis};

/// Evidence that an effect must have: decrease of -2 log likelihood beyond the penalty.
pub const EVIDENCE_MIN: f64 = 9.0;
/// The first effect must take away this share of the open-loop error of the fit runs.
pub const REDUCTION_MIN: f64 = 0.12;
/// Strength that an effect must have: its evidence times the share of the open-loop error that it
/// takes away. Either alone is easily had: thousands of samples make anything significant, and a
/// flexible form takes away some of any error. Its distribution on nulls is [`NULL_STRENGTH`].
pub const STRENGTH_MIN: f64 = 5.0;
/// Strength of the strongest candidate of a search where nothing acts: a share of the searches
/// reaches the first number, and one in e of these another so much more.
/// `dynocar-bench explain --kind none --seeds 400` prints the quantiles that it is fitted to.
pub const NULL_STRENGTH: NullStrength = NullStrength { share: 0.05, at: 2.0, per_e: 1.5 };
/// Two kinds whose evidence differs by less than this explain the data equally well.
pub const AMBIGUOUS: f64 = 6.0;

/// Price of an effect in -2 log likelihood: each parameter costs the logarithm of the number of
/// observations (Schwarz 1978), each choice of a structure twice the logarithm of the number of
/// structures.
pub fn penalty(hypothesis: &SharedHypothesis, observations: usize) -> f64 {
    let parameters = hypothesis.parameters().len() as f64;
    parameters * (observations.max(2) as f64).ln() + hypothesis.choice_cost()
}

/// Decrease of -2 log likelihood by an effect of a fitted model, less what errors that all runs
/// share would bring: (x/s)² becomes x²/(s² + e²), for each parameter.
pub fn discounted(fit: &Fit, index: usize, decrease: f64) -> f64 {
    let effect = &fit.model.effects[index];
    let shared = effect.shared_error();
    if shared == 0.0 || decrease <= 0.0 {
        return decrease;
    }
    let parameters = fit.effect_parameters(index);
    let each = decrease / parameters.len() as f64;
    decrease / (1.0 + each * (shared / effect.size(parameters)).powi(2))
}

/// The price of all effects of a model.
pub fn model_penalty(fit: &Fit) -> f64 {
    let observations = fit.observations();
    fit.model.effects.iter().map(|effect| penalty(effect, observations)).sum()
}

/// The tail of a distribution of strengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NullStrength {
    /// Share of the searches that reach `at`.
    pub share: f64,
    /// A strength.
    pub at: f64,
    /// Further strength by which the share falls to 1/e.
    pub per_e: f64,
}

/// Probability that a search over the whole library finds this strength where nothing acts.
pub fn p_value(strength: f64) -> f64 {
    let NullStrength { share, at, per_e } = NULL_STRENGTH;
    (share * (-(strength - at) / per_e).exp()).clamp(f64::MIN_POSITIVE, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_accepted_is_rare_on_nulls() {
        assert!(p_value(STRENGTH_MIN) <= 0.05);
        assert_eq!(p_value(-1e3), 1.0);
        assert!(p_value(1e6) > 0.0);
    }
}
