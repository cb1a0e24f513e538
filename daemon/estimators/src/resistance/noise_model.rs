//! One model of the rows' noise, with the least squares that follow from it.

use dynocar_core::filter::{Sighting, SquareRootInformation};
use dynocar_core::pipeline::momentum::error::{Disturbance, STATES};
use dynocar_core::pipeline::momentum::{COLUMNS, SinceBlock, UNKNOWNS};

use super::regression::{
    Motion, Observation, RowWhitener, Solution, Unknowns, disturbance_of, loosen_disturbance,
    motion_of,
};

/// Rows for which the noise model as declared counts against the rows seen.
pub const PRIOR_ROWS: f64 = 3.0;
/// Coefficients that take up freedom; the other unknowns have priors.
const FREE: f64 = 3.0;

/// A row with an error of unit variance, as far as the noise is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WhiteRow {
    /// Regressors.
    pub features: Unknowns,
    /// What they should add up to.
    pub observed: f64,
}

/// White noise as the observations declare it and one slow disturbance, both up to a common
/// scale; the generalised least squares of the rows and their restricted likelihood (Patterson
/// and Thompson 1971).
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseModel {
    disturbance: Disturbance,
    whitener: RowWhitener,
    information: SquareRootInformation<UNKNOWNS>,
    log_variances: f64,
}

impl NoiseModel {
    /// A model without rows, with the penalty `sum of weight * unknown^2`.
    pub fn new(disturbance: Disturbance, penalty: &Unknowns) -> Self {
        NoiseModel {
            disturbance,
            whitener: RowWhitener::new(nalgebra::zero(), nalgebra::zero()),
            information: SquareRootInformation::new(penalty, &Unknowns::zeros()),
            log_variances: 0.0,
        }
    }

    /// The disturbance, before the scale.
    pub fn disturbance(&self) -> &Disturbance {
        &self.disturbance
    }

    /// Rows taken in, the forgotten ones in part.
    pub fn count(&self) -> f64 {
        self.information.count()
    }

    /// Moves to the next observation of a chain.
    pub fn propagate(&mut self, observation: &Observation) {
        self.whitener.propagate(&observation.propagation(&self.disturbance));
    }

    /// Moves to the first observation of a chain, so long after the last; unknown when `None`.
    pub fn restart(&mut self, observation: &Observation, gap_s: Option<f64>) {
        self.whitener.propagate(&observation.restart(&self.disturbance, gap_s));
    }

    /// Lets the disturbance have jumped, by so much in N/kN.
    pub fn loosen(&mut self, std_n_per_kn: f64) {
        let root = self.scale().sqrt();
        loosen_disturbance(&mut self.whitener, std_n_per_kn / root);
    }

    /// The row of an observation that the model has moved to; `None` when its variance is not
    /// sound.
    pub fn row(&self, observation: &Observation) -> Option<WhiteRow> {
        let row = self.whitener.row(&observation.sighting())?;
        let columns = row.columns / self.scale().sqrt();
        let features = columns.fixed_rows::<UNKNOWNS>(1).into_owned();
        Some(WhiteRow { features, observed: columns[0] })
    }

    /// Takes in what is seen of an observation that the model has moved to.
    pub fn accept(&mut self, seen: &Sighting<STATES, COLUMNS>, forgetting: f64) {
        let Ok(row) = self.whitener.take(seen) else { return };
        self.information.forget(forgetting);
        self.log_variances = forgetting * self.log_variances + row.variance.ln();
        let features = row.columns.fixed_rows::<UNKNOWNS>(1).into_owned();
        self.information.update(&features, row.columns[0]);
    }

    /// Makes up for what forgetting took off the penalty.
    pub fn add_penalty(&mut self, weights: &Unknowns) {
        self.information.add_penalty(weights);
    }

    /// Adds what is known of the unknowns from elsewhere, a row of unit variance.
    pub fn know(&mut self, features: &Unknowns, observed: f64) {
        self.information.add_knowledge(features, observed);
    }

    /// Degrees of freedom of the residuals; negative while rows are too few.
    pub fn freedom(&self) -> f64 {
        self.count() - FREE
    }

    /// Residual variance of rows of unit variance, the model itself counting for some.
    pub fn scale(&self) -> f64 {
        let freedom = self.freedom().max(0.0);
        (self.information.residual_sum() + PRIOR_ROWS) / (freedom + PRIOR_ROWS)
    }

    /// Restricted log-likelihood with the scale profiled out, up to a constant that models of
    /// the same rows share.
    pub fn log_likelihood(&self) -> f64 {
        -0.5 * (self.freedom() + PRIOR_ROWS) * self.scale().ln()
            - 0.5 * self.log_variances
            - 0.5 * self.information.log_determinant()
    }

    /// Generalised least squares with its covariance; `None` while undetermined.
    pub fn solution(&self) -> Option<Solution> {
        let estimate = self.information.solve().ok()?;
        let covariance = self.information.covariance().ok()? * self.scale();
        Some(Solution { estimate, covariance })
    }

    /// Speed and disturbance now, so long after the newest block.
    pub fn motion(&self, since: &SinceBlock) -> Motion {
        motion_of(&self.whitener, since, &self.disturbance, self.scale())
    }

    /// The disturbance now in N/kN for given unknowns, with its standard deviation.
    pub fn disturbance_now(&self, unknowns: &Unknowns) -> (f64, f64) {
        let (value, variance) = disturbance_of(&self.whitener, unknowns);
        (value, (variance * self.scale()).max(0.0).sqrt())
    }
}
