//! One step of the fit.

use nalgebra::{Cholesky, DVector};

use super::super::model::GrownModel;
use super::linearised::Scratch;
use super::robust::RunFilters;
use super::{DECREASE_MIN, Fit, FitProblem};

impl FitProblem {
    /// A step of Levenberg and Marquardt within the bounds, damped until the cost falls; `None`
    /// when no step promises or brings a decrease.
    pub(super) fn descend(
        &self,
        fit: &Fit,
        score: &DVector<f64>,
        filters: &[RunFilters],
        scratch: &mut Scratch,
    ) -> Option<Fit> {
        for damping in [0.0, 0.01, 0.3, 10.0, 300.0] {
            let (theta, promised) = self.bounded_step(fit, score, damping)?;
            if promised < DECREASE_MIN {
                return None;
            }
            let next = self.linearised(&fit.model, theta, fit.noise, filters, scratch);
            if next.cost < fit.cost {
                return Some(next);
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
    fn bounds(&self, model: &GrownModel) -> Vec<(f64, f64)> {
        let free = [(f64::NEG_INFINITY, f64::INFINITY); 3];
        let of_effects = model
            .effects
            .iter()
            .flat_map(|effect| effect.parameters().iter().map(|spec| (spec.lower, spec.upper)));
        free.into_iter().chain(of_effects).collect()
    }
}
