//! The joint fit of a, b, c and the parameters of all effects.

mod descent;
mod joint;
mod linearised;
mod memory;
mod plan;
mod prior;

use std::sync::{Arc, OnceLock};

use dynocar_model::train::Davis;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::integral::Response;
use super::model::{UpdatedForces, UpdatedModel};
use super::noise::{Noise, RunScatter};
use super::run_data::{Density, RunData, RunDataError, prepare_at};
use super::run_scatter::SharedFilters;
use super::run_scatter::{
    DeviationColumns, FactorMatrix, RunFactors, WeightedFilter, scatter_columns,
};
use super::whitener::BinWhitener;
use crate::dataset::{Dataset, Role};
use crate::parallel;
use memory::RunMemory;
pub use prior::{Positions, RunPositions};

/// Standard deviation of the declared a, b, c as a share of their size: a weak prior that separates directions which
/// the runs do not excite.
const PRIOR_SHARE: [f64; 3] = [0.4, 0.8, 0.4];
/// Degrees of freedom of Student's t distribution of the errors of declared a, b, c: most are small, and some far larger
/// than normal errors are.
const DECLARED_FREEDOM: f64 = 4.0;
/// A declared coefficient is wrong by at most this many standard deviations; data that ask for more, or for a
/// resistance below zero, show a force that the basic resistance does not have.
const DECLARED_DEVIATIONS_MAX: f64 = 8.0;
/// Greatest share of its prior deviation by which a coefficient may fall below zero: an error of estimation.
const BELOW_NONE_MAX: f64 = 0.25;
/// Standard deviation of a coefficient that is held at its bound, as a share of its prior deviation.
const HELD_SHARE: f64 = 1e-3;

/// The runs that are fitted, and the knowledge before the fit.
#[derive(Clone, Debug)]
pub struct FitProblem {
    /// The fit runs.
    pub runs: Vec<RunData>,
    declared: Davis,
    prior_deviation: [f64; 3],
    /// Columns of the runs' own factors.
    scatter_columns: Vec<DeviationColumns>,
    /// Response of the declared model, for each run.
    declared_responses: Vec<Response>,
    /// Evidence of positions on the speeds.
    pub positions: Positions,
}

/// A series of a run that models share.
type Column = Arc<Vec<f64>>;

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

impl RunNormal {
    /// Returns the sums of no run, for a number of parameters.
    pub fn none(count: usize) -> Self {
        RunNormal {
            information: DMatrix::zeros(count, count),
            score: DVector::zeros(count),
            cost: 0.0,
        }
    }

    /// Returns the sums at parameters that are a step away, to second order.
    pub fn moved_by(&self, step: &DVector<f64>) -> Self {
        let pull = &self.information * step;
        RunNormal {
            information: self.information.clone(),
            cost: self.cost - (2.0 * &self.score - &pull).dot(step),
            score: &self.score - pull,
        }
    }

    /// Adds those of another run at the same parameters.
    pub fn add(&mut self, other: &RunNormal) {
        self.information += &other.information;
        self.score += &other.score;
        self.cost += other.cost;
    }
}

/// A fitted model.
#[derive(Clone)]
pub struct Fit {
    /// The model's structure.
    pub model: UpdatedModel,
    /// a, b, c, then the parameters of the effects.
    pub theta: Vec<f64>,
    /// The noise under which it was fitted.
    pub noise: Noise,
    /// Robust -2 log likelihood with the prior, up to a constant.
    pub cost: f64,
    /// Normal equations by run.
    pub runs: Vec<RunNormal>,
    /// Information of prior and distance ratio.
    pub prior_information: DMatrix<f64>,
    /// Score of prior and distance ratio.
    pub prior_score: DVector<f64>,
    /// Information by which those of a, b, c are held that the data push against their bounds.
    held_information: [f64; 3],
    /// White innovations by run, less the runs' own factors.
    pub innovations: Vec<Vec<f64>>,
    /// Whitened regressors by run and parameter, less the share that the runs' own factors would explain; empty for a
    /// parameter that does not touch the run.
    pub columns: Vec<Vec<Column>>,
    /// Differences of the bins by run, not whitened.
    pub residuals: Vec<Vec<f64>>,
    /// The filters by run.
    run_filters: SharedFilters,
    /// The filters of the runs' own factors, with the weights of the innovations.
    pub filters: Vec<WeightedFilter>,
    /// The runs' own factors less 1 and delays, with their covariance.
    factors: Vec<(RunFactors, FactorMatrix)>,
    /// Computed values of each run for the model.
    memories: Arc<[RunMemory]>,
    /// Errors in m/s of its predictions, once somebody asks for them.
    open_loop_mps: OnceLock<[[f64; 3]; 2]>,
}

impl Fit {
    /// Returns the errors in m/s of its predictions, computed once.
    pub fn open_loop_mps(&self, find: impl FnOnce() -> [[f64; 3]; 2]) -> [[f64; 3]; 2] {
        *self.open_loop_mps.get_or_init(find)
    }

    /// Drops its series of innovations, columns and residuals: it still states how good the model is, and starts other
    /// fits, but a scan cannot use it.
    pub fn forget_series(&mut self) {
        self.innovations = Vec::new();
        self.columns = Vec::new();
        self.residuals = Vec::new();
        self.filters = Vec::new();
        self.memories = Arc::default();
    }

    /// Returns the information matrix of all runs and the prior, with coefficients held at their bounds.
    pub fn information(&self) -> DMatrix<f64> {
        let mut information = self.free_information();
        for (i, held) in self.held_information.iter().enumerate() {
            information[(i, i)] += held;
        }
        information
    }

    /// Returns the same with no coefficient held, for the information of the data on a coefficient at its bound.
    ///
    /// A parameter without any information, such as the time constant of an effect of no size, is known to be within
    /// its bounds.
    pub fn free_information(&self) -> DMatrix<f64> {
        let known = self.runs.iter().map(|run| &run.information);
        let mut information = known.fold(self.prior_information.clone(), |sum, run| sum + run);
        for (effect, range) in self.model.effects.iter().zip(self.model.ranges()) {
            for (i, within) in range.zip(effect.parameters()) {
                if information[(i, i)] == 0.0 {
                    // The inverse variance of a number that may be anywhere between them.
                    information[(i, i)] = 12.0 / (within.upper - within.lower).powi(2);
                }
            }
        }
        information
    }

    /// Score of all runs and the prior: nearly none where the fit ended.
    pub fn score(&self) -> DVector<f64> {
        self.runs.iter().fold(self.prior_score.clone(), |sum, run| sum + &run.score)
    }

    /// Cholesky factor of the information matrix; `None` when it is not positive definite.
    pub fn factor(&self) -> Option<Cholesky<f64, Dyn>> {
        Cholesky::new(self.information())
    }

    /// Number of innovations.
    pub fn observations(&self) -> usize {
        self.run_filters.iter().map(|filters| filters.whitener.count()).sum()
    }

    /// The filter of a run, by number.
    pub fn whitener(&self, index: usize) -> &BinWhitener {
        &self.run_filters[index].whitener
    }

    /// Returns whether loads and winds of each run are fitted jointly with the model.
    pub fn has_loads_and_winds(&self) -> bool {
        self.noise.scatter_most == RunScatter::MOST_BESIDE
    }

    /// Returns the factors of one run.
    pub fn own_factors(&self, index: usize) -> &RunFactors {
        &self.factors[index].0
    }

    /// Measured over true speed.
    pub fn speed_scale(&self) -> f64 {
        let effects = self.model.effects.iter().zip(self.model.ranges());
        effects.map(|(effect, range)| effect.speed_scale(&self.theta[range])).product()
    }

    /// The parameters of effect number `index`.
    pub fn effect_parameters(&self, index: usize) -> &[f64] {
        &self.theta[self.model.ranges()[index].clone()]
    }
}

/// Returns the least interval that holds two others.
fn union([low, high]: [f64; 2], [least, greatest]: [f64; 2]) -> [f64; 2] {
    [low.min(least), high.max(greatest)]
}

impl FitProblem {
    /// Makes the runs of a dataset ready, and returns the problem of fitting its fit runs with those held out.
    ///
    /// # Errors
    ///
    /// The first run without usable samples.
    pub fn of(dataset: &Dataset, density: Density) -> Result<(Self, Vec<RunData>), RunDataError> {
        let runs = prepare_at(dataset, density)?.into_iter();
        let (fit, held_out) = runs.partition(|run| run.role == Role::Fit);
        Ok((FitProblem::new(fit, dataset.train.resistance), held_out))
    }

    /// The problem of fitting these runs around declared Davis coefficients.
    pub fn new(runs: Vec<RunData>, declared: Davis) -> Self {
        // A train without a declared coefficient still has a scale for it.
        let least = [0.3, 0.005, 0.0002];
        let sizes = [declared.a, declared.b, declared.c];
        let prior_deviation =
            std::array::from_fn(|i| PRIOR_SHARE[i] * sizes[i].abs().max(least[i]));
        let positions = Positions::of(&runs.iter().map(RunPositions::of).collect::<Vec<_>>());
        let scatter_columns = runs.iter().map(|run| scatter_columns(run, declared)).collect();
        let declared_responses = parallel::of_each(&runs, declared_response);
        FitProblem {
            runs,
            declared,
            prior_deviation,
            scatter_columns,
            declared_responses,
            positions,
        }
    }

    /// Returns the part of the line, in m of chainage, over which the fitted runs of a direction go: effects were
    /// looked for there alone. `None` where none goes that way or tells its positions.
    pub fn reach_m(&self, direction: f64) -> Option<[f64; 2]> {
        let own = self.runs.iter().filter(|run| run.direction == direction);
        own.filter_map(|run| run.span_m).reduce(union)
    }

    /// Returns whether positions show that the speed is late.
    pub fn is_position_ahead(&self) -> bool {
        self.positions.speed_late_s.is_some_and(|(late_s, _)| late_s > 0.0)
    }

    /// Standard deviation of the declared a (0), b (1) or c (2).
    pub fn prior_deviation(&self, coefficient: usize) -> f64 {
        self.prior_deviation[coefficient]
    }

    /// Returns the least and greatest a (0), b (1) or c (2): physically possible, and within the tolerance of the
    /// declared coefficient. A coefficient that is declared as zero has no greatest value.
    fn declared_bounds(&self, coefficient: usize) -> (f64, f64) {
        let Davis { a, b, c } = self.declared;
        let declared = [a, b, c][coefficient];
        let most = DECLARED_DEVIATIONS_MAX * self.prior_deviation[coefficient];
        let greatest = if declared == 0.0 { f64::INFINITY } else { declared + most };
        let least = declared.min(0.0) - BELOW_NONE_MAX * self.prior_deviation[coefficient];
        ((declared - most).max(least), greatest)
    }

    /// Information that holds a, b, c where a score pushes them against their bounds.
    fn held_information(&self, theta: &[f64], score: &DVector<f64>) -> [f64; 3] {
        std::array::from_fn(|i| {
            let (lower, upper) = self.declared_bounds(i);
            let is_held =
                (theta[i] <= lower && score[i] < 0.0) || (theta[i] >= upper && score[i] > 0.0);
            if is_held { (HELD_SHARE * self.prior_deviation[i]).powi(-2) } else { 0.0 }
        })
    }

    /// Standard deviation in N/kN of the force that a noise stands for, on average over some
    /// seconds, and its share of the declared basic resistance; `None` without motion.
    pub fn noise_n_per_kn(&self, noise: Noise, over_s: f64) -> Option<(f64, f64)> {
        let (mut count, mut per_unit, mut basic) = (0.0, 0.0, 0.0);
        for run in &self.runs {
            for bin in &run.bins {
                let sample = &run.samples()[bin.middle()];
                count += 1.0;
                per_unit += sample.weight_kn / sample.inertial_mass_kg;
                basic += self.declared.w0_n_per_kn(bin.speed_mps);
            }
        }
        let n_per_kn = noise.mean_acceleration_mps2(over_s) * count / per_unit;
        (count > 0.0).then(|| (n_per_kn, n_per_kn * count / basic))
    }

    /// Returns the parameters of the model with a, b, c as declared and the effects at given parameters.
    pub fn start(&self, effects: &[f64]) -> Vec<f64> {
        let Davis { a, b, c } = self.declared;
        [a, b, c].iter().chain(effects).copied().collect()
    }
}

fn declared_response(run: &RunData) -> Response {
    let mut response = Response::default();
    let nothing = |_: usize| false;
    let mut forces = UpdatedForces::default();
    UpdatedModel::default().response((run, &[0.0; 3]), nothing, &mut forces, &mut response);
    response
}
