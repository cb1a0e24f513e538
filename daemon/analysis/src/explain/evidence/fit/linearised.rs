//! Cost, residuals, regressors and normal equations at given parameters.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use dynocar_core::filter::lanes::dot;
use nalgebra::{Cholesky, DMatrix, DVector};

use super::super::model::UpdatedModel;
use super::super::noise::Noise;
use super::super::run_data::RunData;
use super::super::run_scatter::scatter_columns;
use super::super::run_scatter::{RunFilters, SharedFilters, WeightedFilter, Whitened};
use super::super::whitener::BinWhitener;
use super::memory::RunMemory;
use super::plan::{At, Plan};
use super::{Column, Fit, FitProblem, RunNormal, declared_response};
use crate::parallel;

/// Residual of one run at given parameters.
pub(super) struct Left {
    whitened: Whitened,
    /// Differences of the bins, not whitened.
    residual: Vec<f64>,
}

impl FitProblem {
    /// Memories of the runs for a model.
    pub(super) fn memories(&self) -> Vec<RunMemory> {
        self.runs.iter().map(|_| RunMemory::default()).collect()
    }

    /// Returns the residual of each run at given parameters.
    pub(super) fn left(
        &self,
        plan: &Plan,
        theta: &[f64],
        filters: &[RunFilters],
        memories: &mut [RunMemory],
    ) -> Vec<Left> {
        parallel::of_each_owned(memories, |index, memory| {
            let (run, declared) = (&self.runs[index], &self.declared_responses[index]);
            Left::of(At { plan, run, declared, theta }, &filters[index], memory)
        })
    }

    /// Returns the cost of the residuals, with the prior.
    pub(super) fn cost(&self, model: &UpdatedModel, theta: &[f64], left: &[Left]) -> f64 {
        left.iter().fold(self.prior(model, theta).2, |cost, run| cost + run.whitened.cost)
    }

    /// Returns residuals, regressors and normal equations at the parameters that left these residuals.
    pub(super) fn linearised(
        &self,
        plan: &Plan,
        model: &UpdatedModel,
        (theta, noise): (Vec<f64>, Noise),
        left: Vec<Left>,
        (filters, memories): (&SharedFilters, &mut [RunMemory]),
    ) -> Fit {
        let (prior_information, prior_score, mut cost) = self.prior(model, &theta);
        let mut fit = Fit {
            model: model.clone(),
            noise,
            cost: 0.0,
            runs: Vec::new(),
            prior_information,
            prior_score,
            held_information: [0.0; 3],
            innovations: Vec::new(),
            columns: Vec::new(),
            residuals: Vec::new(),
            run_filters: filters.clone(),
            filters: Vec::new(),
            factors: Vec::new(),
            memories: Arc::default(),
            open_loop_mps: OnceLock::new(),
            theta,
        };
        let theta = &fit.theta[..];
        let linearised = parallel::of_each_owned(memories, |index, memory| {
            let (run, declared) = (&self.runs[index], &self.declared_responses[index]);
            let at = At { plan, run, declared, theta };
            left[index].normal(model, at, &filters[index], memory)
        });
        for ((normal, free), left) in linearised.into_iter().zip(left) {
            let Whitened { innovations, filter, factors, cost: run_cost } = left.whitened;
            cost += run_cost;
            fit.runs.push(normal);
            fit.innovations.push(innovations);
            fit.columns.push(free);
            fit.residuals.push(left.residual);
            fit.factors.push((factors, filter.covariance));
            fit.filters.push(filter);
        }
        fit.cost = cost;
        fit.held_information = self.held_information(&fit.theta, &fit.score());
        fit
    }

    /// Returns a model with the effects of a fit and one more at no effect; only the columns of this effect are
    /// computed.
    pub(super) fn bordered(&self, plan: &Plan, fit: &Fit, memories: &mut [RunMemory]) -> Fit {
        let mut theta = fit.theta.clone();
        let last = plan.model.effects.len() - 1;
        theta.resize(theta.len() + plan.ranges[last].len(), plan.model.effects[last].none());
        let (prior_information, prior_score, _) = self.prior(plan.model, &theta);
        let steps = difference_steps(plan.model, &theta);
        let bordered = parallel::of_each_owned(memories, |index, memory| {
            let (run, declared) = (&self.runs[index], &self.declared_responses[index]);
            let at = At { plan, run, declared, theta: &theta };
            fit.bordered_run(index, memory.columns_of_last(at, &steps))
        });
        let (runs, columns) = bordered.into_iter().unzip();
        let model = plan.model.clone();
        let mut grown = Fit {
            model,
            theta,
            noise: fit.noise,
            cost: fit.cost,
            runs,
            prior_information,
            prior_score,
            held_information: [0.0; 3],
            innovations: fit.innovations.clone(),
            columns,
            residuals: fit.residuals.clone(),
            run_filters: fit.run_filters.clone(),
            filters: fit.filters.clone(),
            factors: fit.factors.clone(),
            memories: fit.memories.clone(),
            open_loop_mps: OnceLock::new(),
        };
        grown.held_information = self.held_information(&grown.theta, &grown.score());
        grown
    }

    /// Cost that a model, in which only places differ from those of a fit, reaches when all parameters are fitted again, to second order; `run` is
    /// the only run in which it differs from the fit's, by file, `None` when it may in all.
    /// `None` when the parameters are not determined.
    pub fn cost_nearby(&self, fit: &Fit, model: &UpdatedModel, run: Option<&str>) -> Option<f64> {
        let theta = &fit.theta;
        let (mut information, mut score, mut cost) = self.prior(model, theta);
        let moved = parallel::of_each_number(self.runs.len(), |index| {
            let may_differ = run.is_none_or(|run| run == self.runs[index].file);
            may_differ.then(|| self.run_normal(index, model, theta, &fit.run_filters[index]))
        });
        for (moved, fitted) in moved.iter().zip(&fit.runs) {
            let normal = moved.as_ref().unwrap_or(fitted);
            information += &normal.information;
            score += &normal.score;
            cost += normal.cost;
        }
        for (i, held) in fit.held_information.iter().enumerate() {
            information[(i, i)] += held;
        }
        let step = Cholesky::new(information)?.solve(&score);
        Some(cost - score.dot(&step)).filter(|reached| reached.is_finite())
    }

    /// Normal equations of a run that is none of the problem's, under the model, the parameters and the noise of a fit.
    pub fn normal_of(&self, run: &RunData, fit: &Fit) -> RunNormal {
        let (plan, declared) = (Plan::of(&fit.model), declared_response(run));
        let filters = RunFilters::new(run, &scatter_columns(run, self.declared), fit.noise);
        let at = At { plan: &plan, run, declared: &declared, theta: &fit.theta };
        let mut memory = RunMemory::default();
        Left::of(at, &filters, &mut memory).normal(&fit.model, at, &filters, &mut memory).0
    }

    /// Normal equations of one run, by number.
    fn run_normal(
        &self,
        index: usize,
        model: &UpdatedModel,
        theta: &[f64],
        filters: &RunFilters,
    ) -> RunNormal {
        let (run, declared) = (&self.runs[index], &self.declared_responses[index]);
        let plan = Plan::of(model);
        let at = At { plan: &plan, run, declared, theta };
        let mut memory = RunMemory::default();
        Left::of(at, filters, &mut memory).normal(model, at, filters, &mut memory).0
    }
}

impl Left {
    fn of(at: At, filters: &RunFilters, memory: &mut RunMemory) -> Self {
        let (mut bins, mut scratch) = (Vec::new(), Vec::new());
        memory.predict(at, &mut bins);
        let residual: Vec<f64> =
            at.run.bins.iter().zip(&bins).map(|(bin, p)| bin.speed_mps - p).collect();
        let whitened = filters.whitened(&residual, &mut scratch);
        Left { whitened, residual }
    }

    /// Returns the normal equations, and the whitened regressors less the share that the run's own factors would
    /// explain.
    fn normal(
        &self,
        model: &UpdatedModel,
        at: At,
        filters: &RunFilters,
        memory: &mut RunMemory,
    ) -> (RunNormal, Vec<Column>) {
        let mut columns = memory.columns(at, &difference_steps(model, at.theta));
        let Whitened { innovations, filter, cost, .. } = &self.whitened;
        let free = whiten(&filters.whitener, filter, &mut columns);
        let (count, mut rows) = (columns.len(), columns.iter().map(|it| Row::of(it, filter)));
        let mut information = DMatrix::zeros(count, count);
        let mut score = DVector::zeros(count);
        for (i, row) in rows.by_ref().enumerate() {
            score[i] = row.times(innovations);
            for j in 0..=i {
                let sum = row.times(&free[j]);
                (information[(i, j)], information[(j, i)]) = (sum, sum);
            }
        }
        (RunNormal { information, score, cost: *cost }, free)
    }
}

impl Fit {
    /// Normal equations and free columns of one run with some columns more, not whitened.
    fn bordered_run(&self, index: usize, mut more: Vec<Vec<f64>>) -> (RunNormal, Vec<Column>) {
        let filter = &self.filters[index];
        let mut free = self.columns[index].clone();
        let RunNormal { information, score, cost } = &self.runs[index];
        let (before, count) = (free.len(), free.len() + more.len());
        free.extend(whiten(&self.run_filters[index].whitener, filter, &mut more));
        let mut information = information.clone().resize(count, count, 0.0);
        let mut score = score.clone().resize_vertically(count, 0.0);
        for (i, column) in (before..).zip(&more) {
            let row = Row::of(column, filter);
            score[i] = row.times(&self.innovations[index]);
            for j in 0..=i {
                let sum = row.times(&free[j]);
                (information[(i, j)], information[(j, i)]) = (sum, sum);
            }
        }
        (RunNormal { information, score, cost: *cost }, free)
    }
}

/// Whitens columns; returns the share of them that the run's own factors would not explain.
fn whiten(whitener: &BinWhitener, own: &WeightedFilter, columns: &mut [Vec<f64>]) -> Vec<Column> {
    whitener.whiten_all(columns);
    let free = columns.iter().map(|column| own.remove(column, &own.factors(column)));
    free.map(Arc::new).collect()
}

/// Steps for finite differences of the effects' parameters, towards the inside of the bounds.
fn difference_steps(model: &UpdatedModel, theta: &[f64]) -> Vec<f64> {
    let specs = model.effects.iter().flat_map(|effect| effect.parameters());
    theta[3..]
        .iter()
        .zip(specs)
        .map(|(value, spec)| if value + spec.step <= spec.upper { spec.step } else { -spec.step })
        .collect()
}

/// Where a series is more than rounding.
fn support(series: &[f64]) -> Range<usize> {
    const ROUNDING: f64 = 1e-15;
    let most = series.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let counts = |value: &f64| value.abs() > ROUNDING * most;
    let first = series.iter().position(counts).unwrap_or(0);
    first..series.iter().rposition(counts).map_or(first, |last| last + 1)
}

/// A whitened column with the weights of the innovations, where it is more than none.
struct Row {
    weighted: Vec<f64>,
    support: Range<usize>,
}

impl Row {
    fn of(column: &[f64], filter: &WeightedFilter) -> Self {
        let weights = filter.weights();
        let weighted: Vec<f64> =
            column.iter().zip(weights).map(|(value, weight)| weight * value).collect();
        let support = support(&weighted);
        Row { weighted, support }
    }

    /// Its product with a series. One that is empty is zero, and so is a local one far behind its place.
    fn times(&self, other: &[f64]) -> f64 {
        if other.is_empty() {
            return 0.0;
        }
        dot(&self.weighted[self.support.clone()], &other[self.support.clone()])
    }
}
