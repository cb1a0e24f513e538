//! Iteration of the fit, and one step of it.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::super::model::UpdatedModel;
use super::super::noise::{Noise, RunScatter};
use super::super::run_scatter::{RunFilters, SharedFilters, remove};
use super::memory::RunMemory;
use super::plan::Plan;
use super::{Fit, FitProblem};
use crate::explain::hypothesis::SharedHypothesis;
use crate::parallel;

/// Greatest number of Gauss-Newton steps.
const STEPS_MAX: usize = 8;
/// Predicted decrease of the cost below which the fit ends.
const DECREASE_MIN: f64 = 0.02;
/// Number of turns that estimate the loads and winds of the runs.
const APART_TURNS: usize = 2;

impl FitProblem {
    /// Fits a model from a start under a noise.
    pub fn fit(&self, model: &UpdatedModel, start: Vec<f64>, noise: Noise) -> Fit {
        self.fit_remembering(model, (start, noise), self.memories())
    }

    /// Fits a model, the noise that its residuals show, and the model again.
    ///
    /// One turn only: under an undeclared force further turns would take ever more of it for noise.
    pub fn fit_with_noise(&self, model: &UpdatedModel, start: Vec<f64>, noise: Noise) -> Fit {
        self.with_own_noise(&self.fit(model, start, noise))
    }

    /// Fits a model from the declared a, b and c and a start of its effects, with the noise that it leaves.
    pub fn fit_from_declared(&self, model: &UpdatedModel, start: &[f64]) -> Fit {
        let first = self.fit_with_noise(model, self.start(start), Noise::START);
        self.with_own_noise(&first)
    }

    /// The noise that a fit's residuals show, and its model fitted again.
    pub fn with_own_noise(&self, fit: &Fit) -> Fit {
        self.again(fit, self.noise_left_by(fit))
    }

    /// Fits the model of a fit again, under another noise.
    pub fn again(&self, fit: &Fit, noise: Noise) -> Fit {
        self.fit_remembering(&fit.model, (fit.theta.clone(), noise), fit.memories.to_vec())
    }

    /// Fits the model of a fit with some effects more, from starts of theirs.
    pub fn grown(
        &self,
        fit: &Fit,
        more: impl IntoIterator<Item = (SharedHypothesis, Vec<f64>)>,
    ) -> Fit {
        self.grown_if(fit, more, |_, _| true)
    }

    /// Returns the same; a model whose effects do not promise enough stays at its start. `promises` receives the model
    /// there, and the decrease of the cost if the model were linear.
    pub fn grown_if(
        &self,
        fit: &Fit,
        more: impl IntoIterator<Item = (SharedHypothesis, Vec<f64>)>,
        promises: impl Fn(&Fit, f64) -> bool,
    ) -> Fit {
        let (mut model, mut theta) = (fit.model.clone(), fit.theta.clone());
        let mut are_at_none = true;
        for (effect, start) in more {
            are_at_none &= start.iter().all(|value| *value == effect.none());
            model.effects.push(effect);
            theta.extend(start);
        }
        let (plan, grown) = (Plan::of(&fit.model), Plan::of(&model));
        let mut memories = RunMemory::of_grown(&fit.memories, &self.runs, &plan, &grown);
        let filters = &fit.run_filters;
        let is_one = model.effects.len() == fit.model.effects.len() + 1;
        let first = if is_one && are_at_none {
            self.bordered(&grown, fit, &mut memories)
        } else {
            self.first(&grown, &model, (theta, fit.noise), (filters, &mut memories))
        };
        self.descended(&grown, first, (filters, memories), promises)
    }

    /// The model of a fit where loads and winds of ordinary days may set the runs apart, as far as they
    /// show it.
    pub fn with_runs_apart(&self, fit: Fit) -> Fit {
        let most = RunScatter::MOST_BESIDE;
        let noise = Noise { scatter: most, scatter_most: most, ..fit.noise };
        let mut fit = self.renewed(fit, noise);
        for _ in 0..APART_TURNS {
            let noise = self.noise_left_by(&fit);
            fit = self.renewed(fit, noise);
        }
        fit
    }

    /// Fits the model of a fit again, under another noise, with the room that the fit took.
    fn renewed(&self, fit: Fit, noise: Noise) -> Fit {
        let Fit { model, theta, memories, .. } = fit;
        self.fit_remembering(&model, (theta, noise), memories.to_vec())
    }

    /// A model at given parameters, not fitted.
    pub fn at(&self, model: &UpdatedModel, theta: Vec<f64>, noise: Noise) -> Fit {
        let (plan, filters, mut memories) = (Plan::of(model), self.filters(noise), self.memories());
        let mut fit = self.first(&plan, model, (theta, noise), (&filters, &mut memories));
        fit.memories = memories.into();
        fit
    }

    /// A model with a, b and c fitted, in which they are linear, and all else at given parameters.
    pub fn with_davis_fitted(
        &self,
        model: &UpdatedModel,
        mut theta: Vec<f64>,
        noise: Noise,
    ) -> Fit {
        let at = self.at(model, theta.clone(), noise);
        let information = at.information().view((0, 0), (3, 3)).into_owned();
        let Some(factor) = Cholesky::new(information) else { return at };
        let step = factor.solve(&at.score().rows(0, 3));
        for i in 0..3 {
            let (lower, upper) = self.declared_bounds(i);
            theta[i] = (theta[i] + step[i]).clamp(lower, upper);
        }
        self.at(model, theta, noise)
    }

    fn fit_remembering(
        &self,
        model: &UpdatedModel,
        at: (Vec<f64>, Noise),
        mut memories: Vec<RunMemory>,
    ) -> Fit {
        let (plan, filters) = (Plan::of(model), self.filters(at.1));
        let first = self.first(&plan, model, at, (&filters, &mut memories));
        self.descended(&plan, first, (&filters, memories), |_, _| true)
    }

    /// The least cost from a model on, where it promises enough.
    fn descended(
        &self,
        plan: &Plan,
        mut fit: Fit,
        (filters, mut memories): (&SharedFilters, Vec<RunMemory>),
        promises: impl Fn(&Fit, f64) -> bool,
    ) -> Fit {
        let promised = self.bounded_step(&fit, &fit.score(), 0.0).map_or(0.0, |step| step.1);
        let steps = if promises(&fit, promised) { STEPS_MAX } else { 0 };
        for _ in 0..steps {
            let score = fit.score();
            let before = fit.cost;
            if !self.descend(plan, &mut fit, &score, (filters, &mut memories)) {
                break;
            }
            if before - fit.cost < DECREASE_MIN {
                break;
            }
        }
        fit.memories = memories.into();
        fit
    }

    fn first(
        &self,
        plan: &Plan,
        model: &UpdatedModel,
        (theta, noise): (Vec<f64>, Noise),
        (filters, memories): (&SharedFilters, &mut [RunMemory]),
    ) -> Fit {
        let left = self.left(plan, &theta, filters, memories);
        self.linearised(plan, model, (theta, noise), left, (filters, memories))
    }

    /// The noise that the residuals of a fit show.
    fn noise_left_by(&self, fit: &Fit) -> Noise {
        let scatter = RunScatter::updated(&fit.factors, fit.noise.scatter_most);
        let residuals: Vec<Vec<f64>> = fit
            .residuals
            .iter()
            .zip(&self.scatter_columns)
            .zip(&fit.factors)
            .map(|((residual, columns), (factors, _))| remove(columns, residual, factors))
            .collect();
        Noise::estimate(&self.runs, &residuals, Noise { scatter, ..fit.noise })
    }

    fn filters(&self, noise: Noise) -> SharedFilters {
        let filters = parallel::of_each_number(self.runs.len(), |index| {
            RunFilters::new(&self.runs[index], &self.scatter_columns[index], noise)
        });
        filters.into()
    }

    /// A step of Levenberg and Marquardt within the bounds, damped until the cost falls; false
    /// when no step promises or brings a decrease.
    fn descend(
        &self,
        plan: &Plan,
        fit: &mut Fit,
        score: &DVector<f64>,
        (filters, memories): (&SharedFilters, &mut [RunMemory]),
    ) -> bool {
        for damping in [0.0, 0.01, 0.3, 10.0, 300.0] {
            let Some((theta, promised)) = self.bounded_step(fit, score, damping) else {
                return false;
            };
            if promised < DECREASE_MIN {
                return false;
            }
            let left = self.left(plan, &theta, filters, memories);
            if self.cost(&fit.model, &theta, &left) < fit.cost {
                let (model, at) = (fit.model.clone(), (theta, fit.noise));
                fit.forget_series();
                *fit = self.linearised(plan, &model, at, left, (filters, memories));
                return true;
            }
        }
        false
    }

    /// Returns the damped step within the bounds, and the decrease of the cost that it promises, which is never
    /// negative: it goes towards the least cost as far as the nearest bound, then on with the parameter at that bound
    /// held.
    pub(super) fn bounded_step(
        &self,
        fit: &Fit,
        score: &DVector<f64>,
        damping: f64,
    ) -> Option<(Vec<f64>, f64)> {
        let bounds = self.bounds(&fit.model);
        let mut information = fit.information();
        for i in 0..fit.theta.len() {
            information[(i, i)] *= 1.0 + damping;
        }
        let step = self.step_from(fit, &information, score)?;
        let moved = fit.theta.iter().zip(step.iter()).zip(&bounds);
        let theta = moved.map(|((at, step), (lower, upper))| (at + step).clamp(*lower, *upper));
        let curvature = step.dot(&(fit.information() * &step));
        Some((theta.collect(), 2.0 * step.dot(score) - curvature))
    }

    /// Returns the step from a fit that such information and score lead to, within the bounds of its parameters;
    /// `None` where the information is singular.
    pub fn step_from(
        &self,
        fit: &Fit,
        information: &DMatrix<f64>,
        score: &DVector<f64>,
    ) -> Option<DVector<f64>> {
        let bounds = self.bounds(&fit.model);
        let room =
            fit.theta.iter().zip(bounds).map(|(at, (lower, upper))| [lower - at, upper - at]);
        step_within(information, score, &room.collect::<Vec<_>>())
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

/// The step that lowers the cost of a quadratic model: 2 step' score - step' information step grows all the way,
/// and no element leaves its room. `None` where the information is singular.
fn step_within(
    information: &DMatrix<f64>,
    score: &DVector<f64>,
    room: &[[f64; 2]],
) -> Option<DVector<f64>> {
    let count = score.len();
    let (mut step, mut is_held) = (DVector::zeros(count), vec![false; count]);
    loop {
        let (mut free, mut right) = (information.clone(), score - information * &step);
        for held in (0..count).filter(|i| is_held[*i]) {
            free.row_mut(held).fill(0.0);
            free.column_mut(held).fill(0.0);
            (free[(held, held)], right[held]) = (1.0, 0.0);
        }
        let way = Cholesky::new(free)?.solve(&right);
        let share_to_bound = |i: usize| {
            let [lower, upper] = room[i];
            let most = if way[i] > 0.0 { upper - step[i] } else { lower - step[i] };
            (way[i] != 0.0).then(|| (most / way[i]).max(0.0))
        };
        let nearest = (0..count).filter_map(|i| Some((i, share_to_bound(i)?)));
        let nearest = nearest.min_by(|one, other| one.1.total_cmp(&other.1));
        let Some((bound, share)) = nearest.filter(|(_, share)| *share < 1.0) else {
            return Some(step + way);
        };
        step += share * way;
        is_held[bound] = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_within_bounds_always_lowers_the_cost() {
        // A delay at 0.6 and a lag at none, which nearly act alike: the least cost lies outside.
        let information = DMatrix::from_row_slice(2, 2, &[100.0, 99.0, 99.0, 100.0]);
        let score = DVector::from_row_slice(&[-300.0, -290.0]);
        let step = step_within(&information, &score, &[[-0.6, 2.0], [0.0, 2.0]]).unwrap();
        assert_eq!(step[1], 0.0);
        assert_eq!(step[0], -0.6);
        let promised = 2.0 * step.dot(&score) - step.dot(&(&information * &step));
        assert!(promised > 0.0);
        let free = step_within(&information, &score, &[[-99.0, 99.0]; 2]).unwrap();
        assert!((information * free - score).amax() < 1e-9);
    }
}
