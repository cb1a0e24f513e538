//! Cost, residuals, regressors and normal equations at given parameters.

use dynocar_core::filter::lanes::dot;
use nalgebra::{DMatrix, DVector};

use super::super::model::{GrownForces, GrownModel};
use super::super::noise::Noise;
use super::robust::{RunFilters, Whitened};
use super::{Fit, FitProblem, RunNormal};
use crate::explain::evidence::RunData;

/// Working memory of evaluations.
#[derive(Default)]
pub(super) struct Scratch {
    forces: GrownForces,
    bins: Vec<f64>,
    moved: Vec<f64>,
    whitened: Vec<f64>,
}

/// One run at given parameters.
pub(super) struct LinearisedRun {
    pub normal: RunNormal,
    pub whitened: Whitened,
    /// Differences of the bins, not whitened.
    pub residual: Vec<f64>,
    /// Whitened regressors, less what the run's own factors would explain.
    pub free: Vec<Vec<f64>>,
}

impl FitProblem {
    /// Pull of the prior: information and score.
    pub(super) fn prior(
        &self,
        model: &GrownModel,
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
            let at = DVector::from_column_slice(&theta[range.clone()]);
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
        model: &GrownModel,
        theta: &[f64],
        (information, score, cost): (&mut DMatrix<f64>, &mut DVector<f64>, &mut f64),
    ) {
        if let Some((ratio, deviation)) = self.way_ratio {
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

    /// Residuals, regressors and normal equations at given parameters.
    pub(super) fn linearised(
        &self,
        model: &GrownModel,
        theta: Vec<f64>,
        noise: Noise,
        filters: &[RunFilters],
        scratch: &mut Scratch,
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
            theta,
        };
        for (run, filters) in self.runs.iter().zip(filters) {
            let own = Self::run_linearised(model, &fit.theta, run, filters, scratch);
            let Whitened { innovations, filter, factors, cost: run_cost } = own.whitened;
            cost += run_cost;
            fit.runs.push(own.normal);
            fit.innovations.push(innovations);
            fit.columns.push(own.free);
            fit.residuals.push(own.residual);
            fit.factors.push((factors, filter.covariance));
            fit.filters.push(filter);
        }
        fit.cost = cost;
        fit.held_information = self.held_information(&fit.theta, &fit.score());
        fit
    }

    /// The same for one run.
    pub(super) fn run_linearised(
        model: &GrownModel,
        theta: &[f64],
        run: &RunData,
        filters: &RunFilters,
        scratch: &mut Scratch,
    ) -> LinearisedRun {
        model.predict_bins(run, theta, &mut scratch.forces, &mut scratch.bins);
        let residual: Vec<f64> =
            run.bins.iter().zip(&scratch.bins).map(|(bin, p)| bin.speed_mps - p).collect();
        let whitened = filters.whitened(&residual, &mut scratch.whitened);
        let steps = Self::difference_steps(model, theta);
        let columns = whitened_columns(model, run, theta, &steps, filters, scratch);
        let free: Vec<Vec<f64>> = columns
            .iter()
            .map(|column| whitened.filter.remove(column, &whitened.filter.factors(column)))
            .collect();
        let normal = normal_equations(&columns, &free, &whitened);
        LinearisedRun { normal, whitened, residual, free }
    }

    /// Steps for finite differences of the effects' parameters, towards the inside of the bounds.
    fn difference_steps(model: &GrownModel, theta: &[f64]) -> Vec<f64> {
        let specs = model.effects.iter().flat_map(|effect| effect.parameters());
        theta[3..]
            .iter()
            .zip(specs)
            .map(
                |(value, spec)| {
                    if value + spec.step <= spec.upper { spec.step } else { -spec.step }
                },
            )
            .collect()
    }
}

/// Regressors of one run at the parameters of the prediction made last: a, b, c and gradients by their
/// slopes, the others by differences; empty for a parameter that does not touch the run.
fn whitened_columns(
    model: &GrownModel,
    run: &RunData,
    theta: &[f64],
    steps: &[f64],
    filters: &RunFilters,
    scratch: &mut Scratch,
) -> Vec<Vec<f64>> {
    let Scratch { forces, bins, moved, .. } = scratch;
    let mut columns = vec![Vec::new(); theta.len()];
    for (coefficient, column) in columns.iter_mut().take(3).enumerate() {
        forces.davis_slopes(run, coefficient, moved);
        filters.whitener.whiten(moved, column);
    }
    let touched = || {
        model.effects.iter().zip(model.ranges()).flat_map(move |(effect, range)| {
            let from = range.start;
            range.filter(move |i| effect.touches(i - from, run)).map(move |i| (effect, i - from, i))
        })
    };
    let mut permille = Vec::new();
    for (effect, parameter, i) in touched() {
        if effect.is_gradient() {
            effect.gradient_permille(parameter, run, &mut permille);
            forces.gradient_slopes(run, &permille, moved);
            filters.whitener.whiten(moved, &mut columns[i]);
        }
    }
    let mut elsewhere = theta.to_vec();
    for (_, _, i) in touched().filter(|(effect, ..)| !effect.is_gradient()) {
        let step = steps[i - 3];
        elsewhere[i] += step;
        model.predict_bins(run, &elsewhere, forces, moved);
        elsewhere[i] = theta[i];
        for (moved, base) in moved.iter_mut().zip(bins.iter()) {
            *moved = (*moved - base) / step;
        }
        filters.whitener.whiten(moved, &mut columns[i]);
    }
    columns
}

/// `free` are the columns less what the run's own factors would explain.
fn normal_equations(columns: &[Vec<f64>], free: &[Vec<f64>], whitened: &Whitened) -> RunNormal {
    let (count, weights) = (columns.len(), whitened.filter.weights());
    let weighted: Vec<Vec<f64>> = columns
        .iter()
        .map(|column| column.iter().zip(weights).map(|(value, weight)| weight * value).collect())
        .collect();
    // A column that is empty is zero.
    let product = |one: &[f64], other: &[f64]| match one.is_empty() || other.is_empty() {
        true => 0.0,
        false => dot(one, other),
    };
    let mut information = DMatrix::zeros(count, count);
    let mut score = DVector::zeros(count);
    for i in 0..count {
        score[i] = product(&weighted[i], &whitened.innovations);
        for j in 0..=i {
            let sum = product(&weighted[i], &free[j]);
            (information[(i, j)], information[(j, i)]) = (sum, sum);
        }
    }
    RunNormal { information, score, cost: whitened.cost }
}
