//! Cost, residuals, regressors and normal equations at given parameters.

use std::ops::Range;
use std::sync::Arc;

use dynocar_core::filter::lanes::dot;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::super::model::UpdatedModel;
use super::super::noise::Noise;
use super::memory::RunMemory;
use super::plan::{At, Plan};
use super::robust::{RunFilters, Whitened};
use super::{Fit, FitProblem, RunNormal};

/// What a model leaves of one run at given parameters.
pub(super) struct Left {
    whitened: Whitened,
    /// Differences of the bins, not whitened.
    residual: Vec<f64>,
}

impl FitProblem {
    /// Pull of the prior: information and score.
    pub(super) fn prior(
        &self,
        model: &UpdatedModel,
        theta: &[f64],
    ) -> (DMatrix<f64>, DVector<f64>, f64) {
        let count = theta.len();
        let (mut information, mut score) = (DMatrix::zeros(count, count), DVector::zeros(count));
        let mut cost = 0.0;
        let declared = [self.declared.a, self.declared.b, self.declared.c];
        for i in 0..3 {
            let weight = self.prior_deviation[i].powi(-2);
            let away = declared[i] - theta[i];
            information[(i, i)] += weight;
            score[i] += weight * away;
            cost += weight * away * away;
        }
        for (effect, range) in model.effects.iter().zip(model.ranges()) {
            let Some(own) = effect.prior_information() else { continue };
            let at = DVector::from_column_slice(&theta[range.clone()]).add_scalar(-effect.none());
            let pull = own * &at;
            cost += at.dot(&pull);
            let (start, count) = (range.start, range.len());
            let mut block = information.view_mut((start, start), (count, count));
            block += own;
            let mut part = score.rows_mut(start, count);
            part -= pull;
        }
        self.take_positions(model, theta, (&mut information, &mut score, &mut cost));
        (information, score, cost)
    }

    /// What positions say of the scale of the speeds and of how late they are.
    fn take_positions(
        &self,
        model: &UpdatedModel,
        theta: &[f64],
        (information, score, cost): (&mut DMatrix<f64>, &mut DVector<f64>, &mut f64),
    ) {
        if let Some((ratio, deviation)) = self.distance_ratio {
            let mut scale = 1.0;
            let mut at = None;
            for (effect, range) in model.effects.iter().zip(model.ranges()) {
                let own = effect.speed_scale(&theta[range.clone()]);
                if own != 1.0 || effect.changes_speed_scale() {
                    at = Some(range.start);
                }
                scale *= own;
            }
            let away = (ratio - 1.0 / scale) / deviation;
            *cost += away * away;
            if let Some(i) = at {
                let slope = -1.0 / (scale * scale) / deviation;
                information[(i, i)] += slope * slope;
                score[i] += slope * away;
            }
        }
        if let Some((late_s, deviation)) = self.speed_late_s {
            let effects = model.effects.iter().zip(model.ranges());
            let late = effects.filter_map(|(effect, range)| {
                Some((effect.speed_late_s(&theta[range.clone()])?, range))
            });
            let late: Vec<_> = late.collect();
            let known_s: f64 = late.iter().map(|(late_s, _)| late_s).sum();
            let away = (late_s - known_s) / deviation;
            *cost += away * away;
            let numbers: Vec<usize> = late.into_iter().flat_map(|(_, range)| range).collect();
            for &i in &numbers {
                score[i] += away / deviation;
                for &j in &numbers {
                    information[(i, j)] += deviation.powi(-2);
                }
            }
        }
    }

    /// Memories of the runs for a model.
    pub(super) fn memories(&self) -> Vec<RunMemory> {
        self.runs.iter().map(|_| RunMemory::default()).collect()
    }

    /// What a model leaves of each run at given parameters.
    pub(super) fn left(
        &self,
        plan: &Plan,
        theta: &[f64],
        filters: &[RunFilters],
        memories: &mut [RunMemory],
    ) -> Vec<Left> {
        let runs = self.runs.par_iter().zip(&self.declared_responses).zip(filters);
        runs.zip(memories)
            .map(|(((run, declared), filters), memory)| {
                Left::of(At { plan, run, declared, theta }, filters, memory)
            })
            .collect()
    }

    /// The cost of what is left, with the prior.
    pub(super) fn cost(&self, model: &UpdatedModel, theta: &[f64], left: &[Left]) -> f64 {
        left.iter().fold(self.prior(model, theta).2, |cost, run| cost + run.whitened.cost)
    }

    /// Residuals, regressors and normal equations where a model leaves that.
    pub(super) fn linearised(
        &self,
        plan: &Plan,
        model: &UpdatedModel,
        (theta, noise): (Vec<f64>, Noise),
        left: Vec<Left>,
        (filters, memories): (&[RunFilters], &mut [RunMemory]),
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
            whiteners: filters.iter().map(|filters| filters.whitener.clone()).collect(),
            filters: Vec::new(),
            factors: Vec::new(),
            memories: Arc::default(),
            theta,
        };
        let theta = &fit.theta[..];
        let runs = self.runs.par_iter().zip(&self.declared_responses).zip(filters).zip(memories);
        let linearised: Vec<(RunNormal, Vec<Vec<f64>>)> = runs
            .zip(&left)
            .map(|((((run, declared), filters), memory), left)| {
                left.normal(model, At { plan, run, declared, theta }, filters, memory)
            })
            .collect();
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

    /// Normal equations of one run, by number.
    pub(super) fn run_normal(
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

    /// Normal equations, and the whitened regressors less what the run's own factors would explain.
    fn normal(
        &self,
        model: &UpdatedModel,
        at: At,
        filters: &RunFilters,
        memory: &mut RunMemory,
    ) -> (RunNormal, Vec<Vec<f64>>) {
        let mut columns = memory.columns(at, &difference_steps(model, at.theta));
        let mut whitened = Vec::new();
        for column in &mut columns {
            filters.whitener.whiten(column, &mut whitened);
            std::mem::swap(column, &mut whitened);
        }
        let own = &self.whitened.filter;
        let free: Vec<Vec<f64>> =
            columns.iter().map(|column| own.remove(column, &own.factors(column))).collect();
        let normal = normal_equations(&columns, &free, &self.whitened);
        (normal, free)
    }
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

/// `free` are the columns less what the run's own factors would explain.
fn normal_equations(columns: &[Vec<f64>], free: &[Vec<f64>], whitened: &Whitened) -> RunNormal {
    let (count, weights) = (columns.len(), whitened.filter.weights());
    let weighted: Vec<Vec<f64>> = columns
        .iter()
        .map(|column| column.iter().zip(weights).map(|(value, weight)| weight * value).collect())
        .collect();
    // A column that is empty is zero, and so is a local one far behind its place.
    let product = |one: &[f64], range: &Range<usize>, other: &[f64]| match other.is_empty() {
        true => 0.0,
        false => dot(&one[range.clone()], &other[range.clone()]),
    };
    let mut information = DMatrix::zeros(count, count);
    let mut score = DVector::zeros(count);
    for i in 0..count {
        let range = support(&weighted[i]);
        score[i] = product(&weighted[i], &range, &whitened.innovations);
        for j in 0..=i {
            let sum = product(&weighted[i], &range, &free[j]);
            (information[(i, j)], information[(j, i)]) = (sum, sum);
        }
    }
    RunNormal { information, score, cost: whitened.cost }
}
