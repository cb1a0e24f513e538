//! Price of an effect, and the discount on its evidence.

use nalgebra::{Cholesky, DMatrix};

use crate::explain::effects::AtBound;
use crate::explain::evidence::Fit;

/// Returns the price of an effect of a fitted model in -2 log likelihood. Each parameter costs the logarithm of the
/// number of observations (Schwarz 1978), each choice of a structure twice the logarithm of the number of structures.
/// For an effect that depends on one number per run, a run is one observation. Parameters with a prior of their own
/// cost the log determinant by which the data narrow them (Laplace's approximation of the evidence; Rasmussen and
/// Williams 2006, equation 3.32).
pub fn penalty(fit: &Fit, index: usize) -> f64 {
    let effect = &fit.model.effects[index];
    let narrowed = effect.nature().prior.and_then(|prior| narrowed(fit, index, prior));
    let by_count = || {
        let parameters = effect.parameters().len() as f64;
        let observations =
            if effect.nature().is_one_number_a_run { fit.runs.len() } else { fit.observations() };
        parameters * (observations.max(2) as f64).ln()
    };
    narrowed.unwrap_or_else(by_count) + effect.nature().choice_cost
}

/// Returns the logarithm of the determinant of the information about an effect's parameters, all others fitted, over
/// that of the prior; `None` when one of them is singular.
fn narrowed(fit: &Fit, index: usize, prior: &DMatrix<f64>) -> Option<f64> {
    let own = fit.model.ranges()[index].clone();
    let information = fit.information();
    let others: Vec<usize> = (0..fit.theta.len()).filter(|i| !own.contains(i)).collect();
    let rest = information.select_rows(&others).select_columns(&others);
    let log_determinant =
        |matrix: DMatrix<f64>| Some(2.0 * Cholesky::new(matrix)?.l().diagonal().map(f64::ln).sum());
    let all = log_determinant(information)?;
    Some(all - log_determinant(rest)? - log_determinant(prior.clone())?)
}

/// Returns the decrease of -2 log likelihood by an effect of a fitted model, less the decrease that errors shared by
/// all runs would bring: (x/s)² becomes x²/(s² + e²), for each parameter.
pub fn discounted(fit: &Fit, index: usize, decrease: f64) -> f64 {
    let effect = &fit.model.effects[index];
    let shared = effect.nature().shared_error;
    if shared == 0.0 || decrease <= 0.0 {
        return decrease;
    }
    let parameters = fit.effect_parameters(index);
    let each = decrease / parameters.len() as f64;
    decrease / (1.0 + each * (shared / effect.size(parameters)).powi(2))
}

/// Returns the parameter of effect number `index` that lies at a bound of its range.
pub fn at_bound(fit: &Fit, index: usize) -> Option<AtBound> {
    fit.model.effects[index].at_bound(fit.effect_parameters(index))
}

/// The price of all effects of a model.
pub fn model_penalty(fit: &Fit) -> f64 {
    (0..fit.model.effects.len()).map(|index| penalty(fit, index)).sum()
}
