//! The joint fit of a, b, c and the parameters of all effects.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix2, Vector2};

use super::model::{GrownForces, GrownModel};
use super::noise::{Noise, Whitener};
use super::run_data::RunData;
use super::run_scatter::{RunScatter, ScatterFilter, WeightedFilter, scatter_columns};
use crate::train::Davis;

/// Innovations beyond this many standard deviations count linearly (Huber).
const HUBER: f64 = 3.0;
/// Gauss-Newton steps at most.
const STEPS_MAX: usize = 8;
/// A predicted decrease of the cost below this ends the search.
const DECREASE_MIN: f64 = 0.02;
/// Standard deviation of the declared a, b, c as share of their size: a weak prior that keeps
/// directions apart which the runs do not excite.
const PRIOR_SHARE: [f64; 3] = [0.4, 0.8, 0.4];

/// Huber's loss, twice: the square within the bound.
#[inline]
pub(super) fn robust_loss(nu: f64) -> f64 {
    let size = nu.abs();
    if size <= HUBER { nu * nu } else { HUBER * (2.0 * size - HUBER) }
}

/// Weight of an innovation in a normal equation.
#[inline]
pub(super) fn robust_weight(nu: f64) -> f64 {
    let size = nu.abs();
    if size <= HUBER { 1.0 } else { HUBER / size }
}

/// The runs that are fitted and what is known beforehand.
#[derive(Clone, Debug)]
pub struct FitProblem {
    /// The fit runs.
    pub runs: Vec<RunData>,
    declared: Davis,
    prior_deviation: [f64; 3],
    /// Columns of the runs' own factors.
    scatter_columns: Vec<[Vec<f64>; 2]>,
    /// Measured way over way by integrated speed, with its standard deviation.
    pub way_ratio: Option<(f64, f64)>,
}

/// Normal equations of one run at the fitted parameters.
#[derive(Clone, Debug)]
pub struct RunNormal {
    /// Information matrix.
    pub information: DMatrix<f64>,
    /// Score: half the negative gradient of the cost.
    pub score: DVector<f64>,
    /// Robust cost of the run.
    pub cost: f64,
}

/// A fitted model.
#[derive(Clone)]
pub struct Fit {
    /// The model's structure.
    pub model: GrownModel,
    /// a, b, c, then the parameters of the effects.
    pub theta: Vec<f64>,
    /// The noise under which it was fitted.
    pub noise: Noise,
    /// Robust -2 log likelihood with the prior, up to a constant.
    pub cost: f64,
    /// Normal equations by run.
    pub runs: Vec<RunNormal>,
    /// Information of prior and way ratio.
    pub prior_information: DMatrix<f64>,
    /// White innovations by run, less the runs' own factors.
    pub innovations: Vec<Vec<f64>>,
    /// Whitened regressors by run and parameter, less what the runs' own factors would explain.
    pub columns: Vec<Vec<Vec<f64>>>,
    /// Differences of the bins by run, not whitened.
    pub residuals: Vec<Vec<f64>>,
    /// The filters by run.
    pub whiteners: Vec<Whitener>,
    /// The filters of the runs' own factors, with the weights of the innovations.
    pub filters: Vec<WeightedFilter>,
    /// The runs' own factors less 1, with their covariance.
    factors: Vec<(Vector2<f64>, Matrix2<f64>)>,
}

/// The filters of one run under a noise.
#[derive(Clone)]
struct RunFilters {
    whitener: Whitener,
    scatter: ScatterFilter,
}

/// Innovations of one run and what follows from them.
struct Whitened {
    innovations: Vec<f64>,
    filter: WeightedFilter,
    factors: Vector2<f64>,
    cost: f64,
}

impl RunFilters {
    /// Robust innovations of a series of bin differences.
    fn whitened(&self, residual: &[f64], scratch: &mut Vec<f64>) -> Whitened {
        self.whitener.whiten(residual, scratch);
        let weights = |series: &[f64]| series.iter().map(|&nu| robust_weight(nu)).collect();
        let rough = self.scatter.weighted(weights(scratch));
        let less = rough.remove(scratch, &rough.factors(scratch));
        let filter = self.scatter.weighted(weights(&less));
        let factors = filter.factors(scratch);
        let innovations = filter.remove(scratch, &factors);
        let cost = self.whitener.minus_two_log_likelihood(&innovations)
            + self.scatter.prior_cost(&factors)
            + filter.log_determinant;
        Whitened { innovations, filter, factors, cost }
    }
}

impl Fit {
    /// Information matrix of all runs and the prior.
    pub fn information(&self) -> DMatrix<f64> {
        self.runs.iter().fold(self.prior_information.clone(), |sum, run| sum + &run.information)
    }

    /// Cholesky factor of the information matrix; `None` when it is not positive definite.
    pub fn factor(&self) -> Option<Cholesky<f64, Dyn>> {
        Cholesky::new(self.information())
    }

    /// Number of innovations.
    pub fn observations(&self) -> usize {
        self.whiteners.iter().map(Whitener::count).sum()
    }

    /// The parameters of effect number `index`.
    pub fn effect_parameters(&self, index: usize) -> &[f64] {
        &self.theta[self.model.ranges()[index].clone()]
    }
}

/// Working memory of evaluations.
#[derive(Default)]
struct Scratch {
    forces: GrownForces,
    bins: Vec<f64>,
    moved: Vec<f64>,
    whitened: Vec<f64>,
}

impl FitProblem {
    /// The problem of fitting these runs around declared Davis coefficients.
    pub fn new(runs: Vec<RunData>, declared: Davis) -> Self {
        // A train without a declared coefficient still has a scale for it.
        let least = [0.3, 0.005, 0.0002];
        let sizes = [declared.a, declared.b, declared.c];
        let prior_deviation =
            std::array::from_fn(|i| PRIOR_SHARE[i] * sizes[i].abs().max(least[i]));
        let way_ratio = pooled_way_ratio(&runs);
        let scatter_columns = runs.iter().map(|run| scatter_columns(run, declared)).collect();
        FitProblem { runs, declared, prior_deviation, scatter_columns, way_ratio }
    }

    /// The model with a, b, c as declared and the effects at given parameters.
    pub fn start(&self, effects: &[f64]) -> Vec<f64> {
        let Davis { a, b, c } = self.declared;
        [a, b, c].iter().chain(effects).copied().collect()
    }

    /// Fits a model from a start under a noise.
    pub fn fit(&self, model: &GrownModel, start: Vec<f64>, noise: Noise) -> Fit {
        let filters = self.filters(noise);
        let mut scratch = Scratch::default();
        let mut fit = self.linearised(model, start, noise, &filters, &mut scratch);
        for _ in 0..STEPS_MAX {
            let score = self.score(&fit);
            let Some(next) = self.descend(&fit, &score, &filters, &mut scratch) else { break };
            let gained = fit.cost - next.cost;
            fit = next;
            if gained < DECREASE_MIN {
                break;
            }
        }
        fit
    }

    /// Fits a model, the noise that its residuals show, and the model again.
    ///
    /// One turn only: under an undeclared force further turns would take ever more of it for noise.
    pub fn fit_with_noise(&self, model: &GrownModel, start: Vec<f64>, noise: Noise) -> Fit {
        let fit = self.fit(model, start, noise);
        let scatter = RunScatter::updated(&fit.factors);
        let residuals: Vec<Vec<f64>> = fit
            .residuals
            .iter()
            .zip(&self.scatter_columns)
            .zip(&fit.factors)
            .map(|((residual, [force, resistance]), (factors, _))| {
                let columns = force.iter().zip(resistance);
                let less = residual.iter().zip(columns);
                less.map(|(value, (f, r))| value - factors[0] * f - factors[1] * r).collect()
            })
            .collect();
        let noise = Noise::estimate(&self.runs, &residuals, Noise { scatter, ..noise });
        self.fit(model, fit.theta, noise)
    }

    fn filters(&self, noise: Noise) -> Vec<RunFilters> {
        self.runs
            .iter()
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
            if self.cost(&fit.model, &theta, filters, scratch) < fit.cost {
                return Some(self.linearised(&fit.model, theta, fit.noise, filters, scratch));
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

    /// Pull of the prior: information and score.
    fn prior(&self, model: &GrownModel, theta: &[f64]) -> (DMatrix<f64>, DVector<f64>, f64) {
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

    fn score(&self, fit: &Fit) -> DVector<f64> {
        let prior = self.prior(&fit.model, &fit.theta).1;
        fit.runs.iter().fold(prior, |sum, run| sum + &run.score)
    }

    fn cost(
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
    fn linearised(
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
    fn difference_steps(&self, model: &GrownModel, theta: &[f64]) -> Vec<f64> {
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

/// The ratios of all runs together. Wheel creep, rounding and the places where a run starts are
/// common to the runs: below `COMMON` nothing is told.
fn pooled_way_ratio(runs: &[RunData]) -> Option<(f64, f64)> {
    const COMMON: f64 = 0.001;
    let mut ratios: Vec<f64> = runs.iter().filter_map(|run| Some(run.way_ratio?.0)).collect();
    if ratios.is_empty() {
        return None;
    }
    ratios.sort_unstable_by(f64::total_cmp);
    let middle = ratios.len() / 2;
    let median = if ratios.len() % 2 == 1 {
        ratios[middle]
    } else {
        0.5 * (ratios[middle - 1] + ratios[middle])
    };
    let mean_var: f64 = runs.iter().filter_map(|run| Some(run.way_ratio?.1.powi(2))).sum::<f64>()
        / ratios.len() as f64;
    let deviation = (mean_var / ratios.len() as f64 + COMMON * COMMON).sqrt();
    Some((median, deviation))
}
