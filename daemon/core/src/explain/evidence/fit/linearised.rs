//! Cost, residuals, regressors and normal equations at given parameters.

use nalgebra::{DMatrix, DVector};

use super::super::model::{GrownForces, GrownModel};
use super::super::noise::Noise;
use super::robust::{RunFilters, Whitened};
use super::{Fit, FitProblem, RunNormal};

/// Working memory of evaluations.
#[derive(Default)]
pub(super) struct Scratch {
    forces: GrownForces,
    bins: Vec<f64>,
    moved: Vec<f64>,
    whitened: Vec<f64>,
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
            cost += away * away;
            if let Some(i) = at {
                let slope = -1.0 / (scale * scale) / deviation;
                information[(i, i)] += slope * slope;
                score[i] += slope * away;
            }
        }
        (information, score, cost)
    }

    pub(super) fn score(&self, fit: &Fit) -> DVector<f64> {
        let prior = self.prior(&fit.model, &fit.theta).1;
        fit.runs.iter().fold(prior, |sum, run| sum + &run.score)
    }

    pub(super) fn cost(
        &self,
        model: &GrownModel,
        theta: &[f64],
        filters: &[RunFilters],
        scratch: &mut Scratch,
    ) -> f64 {
        let mut total = self.prior(model, theta).2;
        for (run, filters) in self.runs.iter().zip(filters) {
            model.predict_bins(run, theta, &mut scratch.forces, &mut scratch.bins);
            for (value, bin) in scratch.bins.iter_mut().zip(&run.bins) {
                *value = bin.speed_mps - *value;
            }
            total += filters.whitened(&scratch.bins, &mut scratch.whitened).cost;
        }
        total
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
        let steps = self.difference_steps(model, &theta);
        let (prior_information, _, mut cost) = self.prior(model, &theta);
        let mut fit = Fit {
            model: model.clone(),
            noise,
            cost: 0.0,
            runs: Vec::new(),
            prior_information,
            innovations: Vec::new(),
            columns: Vec::new(),
            residuals: Vec::new(),
            whiteners: filters.iter().map(|filters| filters.whitener.clone()).collect(),
            filters: Vec::new(),
            factors: Vec::new(),
            theta,
        };
        for (run, filters) in self.runs.iter().zip(filters) {
            model.predict_bins(run, &fit.theta, &mut scratch.forces, &mut scratch.bins);
            let residual: Vec<f64> =
                run.bins.iter().zip(&scratch.bins).map(|(bin, p)| bin.speed_mps - p).collect();
            let whitened = filters.whitened(&residual, &mut scratch.whitened);
            let columns: Vec<Vec<f64>> = steps
                .iter()
                .enumerate()
                .map(|(i, &step)| {
                    let mut theta = fit.theta.clone();
                    theta[i] += step;
                    model.predict_bins(run, &theta, &mut scratch.forces, &mut scratch.moved);
                    for (moved, base) in scratch.moved.iter_mut().zip(&scratch.bins) {
                        *moved = (*moved - base) / step;
                    }
                    let mut column = Vec::new();
                    filters.whitener.whiten(&scratch.moved, &mut column);
                    column
                })
                .collect();
            let Whitened { innovations, filter, factors, cost: run_cost } = whitened;
            cost += run_cost;
            let free: Vec<Vec<f64>> = columns
                .iter()
                .map(|column| filter.remove(column, &filter.factors(column)))
                .collect();
            fit.runs.push(normal_equations(
                &columns,
                &free,
                &innovations,
                filter.weights(),
                run_cost,
            ));
            fit.innovations.push(innovations);
            fit.columns.push(free);
            fit.residuals.push(residual);
            fit.factors.push((factors, filter.covariance));
            fit.filters.push(filter);
        }
        fit.cost = cost;
        fit
    }

    /// Steps for finite differences, towards the inside of the bounds.
    pub(super) fn difference_steps(&self, model: &GrownModel, theta: &[f64]) -> Vec<f64> {
        let mut steps: Vec<f64> = self.prior_deviation.iter().map(|sd| 0.05 * sd).collect();
        for (effect, range) in model.effects.iter().zip(model.ranges()) {
            for (value, spec) in theta[range].iter().zip(effect.parameters()) {
                let inside = value + spec.step <= spec.upper;
                steps.push(if inside { spec.step } else { -spec.step });
            }
        }
        steps
    }
}

/// `free` are the columns less what the run's own factors would explain.
fn normal_equations(
    columns: &[Vec<f64>],
    free: &[Vec<f64>],
    innovations: &[f64],
    weights: &[f64],
    cost: f64,
) -> RunNormal {
    let count = columns.len();
    let product = |one: &[f64], other: &[f64]| -> f64 {
        one.iter().zip(other).zip(weights).map(|((one, other), weight)| weight * one * other).sum()
    };
    let mut information = DMatrix::zeros(count, count);
    let mut score = DVector::zeros(count);
    for i in 0..count {
        score[i] = product(&columns[i], innovations);
        for j in 0..=i {
            let sum = product(&columns[i], &free[j]);
            (information[(i, j)], information[(j, i)]) = (sum, sum);
        }
    }
    RunNormal { information, score, cost }
}
