//! The observations of the linear regression of [`dynocar_core::pipeline::momentum`], and one model of their noise,
//! with the resulting least squares.

use dynocar_core::filter::{Propagation, Sighting, SquareRootInformation, Whitener};
use dynocar_core::pipeline::momentum::{
    COLUMNS, DISTURBANCE, Disturbance, MOMENTUM, MomentumBlock, MomentumColumns, STATES,
    SinceBlock, UNKNOWNS, momentum_seen,
};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

/// Values of the unknowns.
pub type Unknowns = SVector<f64, UNKNOWNS>;
/// The filter that makes rows independent.
pub type RowWhitener = Whitener<STATES, COLUMNS>;

/// Estimate of the unknowns with its covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegressionSolution {
    /// The unknowns.
    pub estimate: Unknowns,
    /// Covariance for intervals by the normal distribution.
    pub covariance: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
}

/// Speed in m/s, then disturbance in N/kN, as affine functions of the unknowns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AffineMotion {
    /// Their values for unknowns of 0.
    pub at_zero: Vector2<f64>,
    /// Their derivatives by the unknowns.
    pub gain: SMatrix<f64, STATES, UNKNOWNS>,
    /// Their covariance for known unknowns.
    pub covariance: Matrix2<f64>,
}

/// Least-squares slope of the speed over a coasting segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoastingSegment {
    /// True when it shares its first half with no segment before it.
    pub is_first: bool,
    /// Resistance after known forces in N/kN, then the mean regressors with the slope's weights.
    pub row: MomentumColumns,
    /// The row of the segment before, which shares half of the samples; unused in the first.
    pub row_before: MomentumColumns,
    /// Variance of the resistance by the noise of the speed.
    pub variance: f64,
    /// Time in s from the segment before.
    pub step_s: f64,
    /// Time of the newest sample in ns.
    pub time_ns: i64,
    /// Mean speed in m/s.
    pub speed_mps: f64,
}

/// One observation of the regression, of either source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RegressionObservation {
    /// From measured forces.
    Block(MomentumBlock),
    /// From coasting.
    Segment(CoastingSegment),
}

/// Half-overlapping slopes correlate by -1/4 (white noise, equal halves), which is a moving
/// average of new errors, `e_k + OVERLAP e_{k-1}`: OVERLAP / (1 + OVERLAP²) = -1/4.
const OVERLAP: f64 = -0.267_949_192_431_122_7;

impl RegressionObservation {
    /// Returns whether nothing before it is connected with it.
    pub fn is_first(&self) -> bool {
        match self {
            RegressionObservation::Block(block) => block.is_first,
            RegressionObservation::Segment(segment) => segment.is_first,
        }
    }

    /// Returns the time of the newest sample in ns.
    pub fn time_ns(&self) -> i64 {
        match self {
            RegressionObservation::Block(block) => block.time_ns,
            RegressionObservation::Segment(segment) => segment.time_ns,
        }
    }

    /// Returns how the error moves to the first observation of a chain: momentum is new, and the
    /// disturbance has gone on for `gap_s`; unknown for how long when `None`. A block is used up
    /// by it.
    pub fn restart(
        &self,
        disturbance: &Disturbance,
        gap_s: Option<f64>,
    ) -> Propagation<STATES, COLUMNS> {
        match self {
            RegressionObservation::Block(block) => {
                disturbance.across_gap(gap_s, block.momentum, block.momentum_variance)
            }
            RegressionObservation::Segment(_) => disturbance.decay(gap_s.unwrap_or(f64::INFINITY)),
        }
    }

    /// Returns how the error moves from the observation before to this one.
    pub fn propagation(&self, disturbance: &Disturbance) -> Propagation<STATES, COLUMNS> {
        match self {
            RegressionObservation::Block(block) => {
                disturbance.over_impulse(block.impulse[1], &block.impulse, block.impulse_variance)
            }
            RegressionObservation::Segment(segment) => {
                // The new error of the row before is that row less its other parts.
                let mut step: Propagation<STATES, COLUMNS> = disturbance.decay(segment.step_s);
                step.transition[(MOMENTUM, MOMENTUM)] = -OVERLAP;
                step.transition[(MOMENTUM, DISTURBANCE)] = -OVERLAP;
                step.input.set_row(MOMENTUM, &(segment.row_before * OVERLAP).transpose());
                step
            }
        }
    }

    /// Returns the observation of the error.
    pub fn sighting(&self) -> Sighting<STATES, COLUMNS> {
        match self {
            RegressionObservation::Block(block) => {
                momentum_seen(block.momentum, block.momentum_variance)
            }
            RegressionObservation::Segment(segment) => Sighting {
                direction: Vector2::new(1.0, 1.0),
                observed: segment.row,
                variance: segment.variance / (1.0 + OVERLAP * OVERLAP),
            },
        }
    }
}

/// Rows for which the noise model as declared counts against the rows seen.
pub const PRIOR_ROWS: f64 = 3.0;
/// Coefficients that take up freedom; the other unknowns have priors.
const FREE: f64 = 3.0;

/// A row with an error of unit variance, as far as the noise is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WhiteRow {
    /// Regressors.
    pub features: Unknowns,
    /// Observed sum.
    pub observed: f64,
}

/// White noise as the observations declare it and one slow disturbance, both up to a common
/// scale; the generalised least squares of the rows and their restricted likelihood (Patterson
/// and Thompson 1971).
#[derive(Clone, Debug, PartialEq)]
pub struct RegressionNoise {
    /// The disturbance, before the scale.
    pub disturbance: Disturbance,
    whitener: RowWhitener,
    /// The information on the unknowns.
    pub information: SquareRootInformation<UNKNOWNS>,
    log_variances: f64,
}

impl RegressionNoise {
    /// Returns a model without rows, with the penalty `sum of weight * unknown^2`.
    pub fn new(disturbance: Disturbance, penalty: &Unknowns) -> Self {
        RegressionNoise {
            disturbance,
            whitener: RowWhitener::new(nalgebra::zero(), nalgebra::zero()),
            information: SquareRootInformation::new(penalty, &Unknowns::zeros()),
            log_variances: 0.0,
        }
    }

    /// Returns the rows taken in, the forgotten ones in part.
    pub fn count(&self) -> f64 {
        self.information.count()
    }

    /// Moves to the next observation of a chain.
    pub fn propagate(&mut self, observation: &RegressionObservation) {
        self.whitener.propagate(&observation.propagation(&self.disturbance));
    }

    /// Moves to the first observation of a chain, so long after the last; unknown when `None`.
    pub fn restart(&mut self, observation: &RegressionObservation, gap_s: Option<f64>) {
        self.whitener.propagate(&observation.restart(&self.disturbance, gap_s));
    }

    /// Lets the disturbance have jumped, by so much in N/kN.
    pub fn loosen(&mut self, std_n_per_kn: f64) {
        let root = self.scale().sqrt();
        self.whitener.loosen(DISTURBANCE, (std_n_per_kn / root).powi(2));
    }

    /// Returns the row of an observation that the model has moved to; `None` when its variance is not
    /// sound.
    pub fn row(&self, observation: &RegressionObservation) -> Option<WhiteRow> {
        let row = self.whitener.row(&observation.sighting())?;
        let columns = row.columns / self.scale().sqrt();
        let features = columns.fixed_rows::<UNKNOWNS>(1).into_owned();
        Some(WhiteRow { features, observed: columns[0] })
    }

    /// Takes in the sighting of an observation that the model has moved to.
    pub fn accept(&mut self, seen: &Sighting<STATES, COLUMNS>, forgetting: f64) {
        let Ok(row) = self.whitener.take(seen) else { return };
        self.information.forget(forgetting);
        self.log_variances = forgetting * self.log_variances + row.variance.ln();
        let features = row.columns.fixed_rows::<UNKNOWNS>(1).into_owned();
        self.information.update(&features, row.columns[0]);
    }

    /// Degrees of freedom of the residuals; negative while rows are too few.
    pub fn freedom(&self) -> f64 {
        self.count() - FREE
    }

    /// Returns the residual variance of rows of unit variance, the model itself counting for some.
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
    pub fn solution(&self) -> Option<RegressionSolution> {
        let estimate = self.information.solve().ok()?;
        let covariance = self.information.covariance().ok()? * self.scale();
        Some(RegressionSolution { estimate, covariance })
    }

    /// Returns the speed and disturbance now, so long after the newest block.
    pub fn motion(&self, since: &SinceBlock) -> AffineMotion {
        let duration_s = since.impulse[1];
        let mut to_now = Matrix2::identity();
        to_now[(MOMENTUM, DISTURBANCE)] = -duration_s;
        let mut columns = to_now * self.whitener.state;
        for (column, impulse) in since.impulse.iter().enumerate() {
            columns[(MOMENTUM, column)] += impulse;
        }
        // A random walk of the disturbance, integrated twice.
        let walk = 2.0 * self.disturbance.std_n_per_kn.powi(2) / self.disturbance.time_s;
        let mut covariance = to_now * self.whitener.covariance * to_now.transpose();
        covariance[(MOMENTUM, MOMENTUM)] += walk * duration_s.powi(3) / 3.0;
        covariance[(DISTURBANCE, DISTURBANCE)] += walk * duration_s;
        let to_speed = Matrix2::new(1.0 / since.inertia, 0.0, 0.0, 1.0);
        let columns = to_speed * columns;
        AffineMotion {
            at_zero: columns.column(0).into_owned(),
            gain: -columns.fixed_columns::<UNKNOWNS>(1),
            covariance: to_speed * covariance * to_speed * self.scale(),
        }
    }

    /// Returns the disturbance now in N/kN for given unknowns, with its standard deviation.
    pub fn disturbance_now(&self, unknowns: &Unknowns) -> (f64, f64) {
        let columns = self.whitener.state.row(DISTURBANCE);
        let taken: f64 = (0..UNKNOWNS).map(|i| columns[i + 1] * unknowns[i]).sum();
        let variance = self.whitener.covariance[(DISTURBANCE, DISTURBANCE)];
        (columns[0] - taken, (variance * self.scale()).max(0.0).sqrt())
    }
}
