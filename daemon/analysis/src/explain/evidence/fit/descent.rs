//! The search of the fit, and one step of it.

use nalgebra::{Cholesky, DVector};
use rayon::prelude::*;

use super::super::model::UpdatedModel;
use super::super::noise::{Noise, RunScatter};
use super::super::run_scatter::{ScatterFilter, remove};
use super::super::whitener::Whitener;
use super::memory::{Plan, RunMemory};
use super::robust::RunFilters;
use super::{Fit, FitProblem};

/// Gauss-Newton steps at most.
const STEPS_MAX: usize = 8;
/// A predicted decrease of the cost below this ends the search.
const DECREASE_MIN: f64 = 0.02;

impl FitProblem {
    /// Fits a model from a start under a noise.
    pub fn fit(&self, model: &UpdatedModel, start: Vec<f64>, noise: Noise) -> Fit {
        self.fit_remembering(model, start, noise, &mut self.memories())
    }

    fn fit_remembering(
        &self,
        model: &UpdatedModel,
        start: Vec<f64>,
        noise: Noise,
        memories: &mut [RunMemory],
    ) -> Fit {
        let (plan, filters) = (Plan::of(model), self.filters(noise));
        let mut fit = self.first(&plan, model, (start, noise), (&filters, memories));
        for _ in 0..STEPS_MAX {
            let score = fit.score();
            let Some(next) = self.descend(&plan, &fit, &score, (&filters, memories)) else { break };
            let gained = fit.cost - next.cost;
            fit = next;
            if gained < DECREASE_MIN {
                break;
            }
        }
        fit
    }

    fn first(
        &self,
        plan: &Plan,
        model: &UpdatedModel,
        (theta, noise): (Vec<f64>, Noise),
        (filters, memories): (&[RunFilters], &mut [RunMemory]),
    ) -> Fit {
        let left = self.left(plan, &theta, filters, memories);
        self.linearised(plan, model, (theta, noise), left, (filters, memories))
    }

    /// A model at given parameters, not fitted.
    pub fn at(&self, model: &UpdatedModel, theta: Vec<f64>, noise: Noise) -> Fit {
        let (plan, filters) = (Plan::of(model), self.filters(noise));
        self.first(&plan, model, (theta, noise), (&filters, &mut self.memories()))
    }

    /// Fits a model, the noise that its residuals show, and the model again.
    ///
    /// One turn only: under an undeclared force further turns would take ever more of it for noise.
    pub fn fit_with_noise(&self, model: &UpdatedModel, start: Vec<f64>, noise: Noise) -> Fit {
        let mut memories = self.memories();
        let fit = self.fit_remembering(model, start, noise, &mut memories);
        let scatter = RunScatter::updated(&fit.factors);
        let residuals: Vec<Vec<f64>> = fit
            .residuals
            .iter()
            .zip(&self.scatter_columns)
            .zip(&fit.factors)
            .map(|((residual, columns), (factors, _))| remove(columns, residual, factors))
            .collect();
        let noise = Noise::estimate(&self.runs, &residuals, Noise { scatter, ..noise });
        self.fit_remembering(model, fit.theta, noise, &mut memories)
    }

    pub(super) fn filters(&self, noise: Noise) -> Vec<RunFilters> {
        self.runs
            .par_iter()
            .zip(&self.scatter_columns)
            .map(|(run, columns)| {
                let whitener = Whitener::new(run, noise);
                let scatter = ScatterFilter::new(columns, &whitener, noise.scatter);
                RunFilters { whitener, scatter }
            })
            .collect()
    }

    /// A step of Levenberg and Marquardt within the bounds, damped until the cost falls; `None`
    /// when no step promises or brings a decrease.
    fn descend(
        &self,
        plan: &Plan,
        fit: &Fit,
        score: &DVector<f64>,
        (filters, memories): (&[RunFilters], &mut [RunMemory]),
    ) -> Option<Fit> {
        for damping in [0.0, 0.01, 0.3, 10.0, 300.0] {
            let (theta, promised) = self.bounded_step(fit, score, damping)?;
            if promised < DECREASE_MIN {
                return None;
            }
            let left = self.left(plan, &theta, filters, memories);
            if self.cost(&fit.model, &theta, &left) < fit.cost {
                let at = (theta, fit.noise);
                return Some(self.linearised(plan, &fit.model, at, left, (filters, memories)));
            }
        }
        None
    }

    /// The damped step with every parameter that would leave its bounds held at the bound, and
    /// the decrease of the cost that it promises.
    fn bounded_step(
        &self,
        fit: &Fit,
        score: &DVector<f64>,
        damping: f64,
    ) -> Option<(Vec<f64>, f64)> {
        let bounds = self.bounds(&fit.model);
        let count = fit.theta.len();
        let mut fixed: Vec<Option<f64>> = vec![None; count];
        loop {
            let mut information = fit.information();
            let mut right = score.clone();
            for i in 0..count {
                information[(i, i)] *= 1.0 + damping;
            }
            for (i, step) in fixed.iter().enumerate() {
                let Some(step) = *step else { continue };
                for k in 0..count {
                    right[k] -= information[(k, i)] * step;
                    (information[(k, i)], information[(i, k)]) = (0.0, 0.0);
                }
                (information[(i, i)], right[i]) = (1.0, step);
            }
            let step = Cholesky::new(information)?.solve(&right);
            let outside = (0..count).find_map(|i| {
                let (lower, upper) = bounds[i];
                let moved = fit.theta[i] + step[i];
                let kept = moved.clamp(lower, upper);
                (fixed[i].is_none() && kept != moved).then_some((i, kept - fit.theta[i]))
            });
            match outside {
                Some((i, kept)) => fixed[i] = Some(kept),
                None => {
                    let theta = (0..count)
                        .map(|i| (fit.theta[i] + step[i]).clamp(bounds[i].0, bounds[i].1))
                        .collect();
                    let curvature = step.dot(&(fit.information() * &step));
                    return Some((theta, 2.0 * step.dot(score) - curvature));
                }
            }
        }
    }

    /// Bounds of all parameters.
    fn bounds(&self, model: &UpdatedModel) -> Vec<(f64, f64)> {
        let declared = [0, 1, 2].map(|coefficient| self.declared_bounds(coefficient));
        let of_effects = model
            .effects
            .iter()
            .flat_map(|effect| effect.parameters().iter().map(|spec| (spec.lower, spec.upper)));
        declared.into_iter().chain(of_effects).collect()
    }
}
