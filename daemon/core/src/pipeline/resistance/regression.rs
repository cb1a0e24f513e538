//! The linear regression that resistance estimators share.
//!
//! In momentum per weight, with s = 1000 (1 + gamma) / g, the declared model reads
//! `s dv/dt = f(t) - w0(v)`, f being the driving force in N per kN of weight (Liu 2018, eq. 5,
//! whose printed factor 100 lacks rotating mass and rounds 1000/g). It is linear in Davis a, b
//! and c whatever window it is integrated over.

use dynocar_model::train::Davis;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2, Vector3};

use super::momentum_error::{DISTURBANCE, Disturbance, MOMENTUM, STATES, momentum_seen};
use crate::filter::{Propagation, Sighting, Whitener};

/// Davis a, b, c.
pub const PARAMETERS: usize = 3;
/// All that a row depends on: Davis a, b, c, then what is not exactly known of the forces, in
/// this order: the scale of traction, the scale of the brake, the delay in s of both.
pub const UNKNOWNS: usize = 6;
/// Index of the error of the traction force's scale among the unknowns.
pub const TRACTION_SCALE: usize = 3;
/// Index of the error of the brake force's scale among the unknowns.
pub const BRAKE_SCALE: usize = 4;
/// Index of the delay in s of a force behind its report among the unknowns.
pub const FORCE_DELAY: usize = 5;
/// Columns of a row: the known part, then what each unknown takes off it.
pub const COLUMNS: usize = 1 + UNKNOWNS;
/// Regressors are 1, v/20 and (v/20)²: of one magnitude over the speeds of trains.
pub const SPEED_SCALE_MPS: f64 = 20.0;

/// Known part and regressors by column.
pub type Columns = SVector<f64, COLUMNS>;
/// Values of the unknowns.
pub type Unknowns = SVector<f64, UNKNOWNS>;
/// The filter that makes rows independent.
pub type RowWhitener = Whitener<STATES, COLUMNS>;

/// Estimate of the unknowns with its covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// The unknowns.
    pub estimate: Unknowns,
    /// Covariance for intervals by the normal distribution.
    pub covariance: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
}

/// The scaled regressors of w0 at a speed in m/s.
pub fn regressors(speed_mps: f64) -> [f64; PARAMETERS] {
    let scaled = speed_mps / SPEED_SCALE_MPS;
    [1.0, scaled, scaled * scaled]
}

/// Scaled parameters, all in N/kN, of Davis coefficients.
pub fn scaled(davis: &Davis) -> Vector3<f64> {
    Vector3::new(davis.a, davis.b * SPEED_SCALE_MPS, davis.c * SPEED_SCALE_MPS * SPEED_SCALE_MPS)
}

/// Factors that turn scaled parameters into Davis coefficients.
pub fn unscaling() -> Vector3<f64> {
    Vector3::new(1.0, 1.0 / SPEED_SCALE_MPS, 1.0 / (SPEED_SCALE_MPS * SPEED_SCALE_MPS))
}

/// Speed in m/s, then disturbance in N/kN, as affine functions of the unknowns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Their values were all unknowns 0.
    pub at_zero: Vector2<f64>,
    /// Their derivatives by the unknowns.
    pub gain: SMatrix<f64, STATES, UNKNOWNS>,
    /// Their covariance for known unknowns.
    pub covariance: Matrix2<f64>,
}

/// What has happened since the middle of the newest block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SinceBlock {
    /// The integral of the driving force, then what each unknown takes off it.
    pub impulse: Columns,
    /// Momentum per weight and speed.
    pub inertia: f64,
}

/// Mean momentum of a block of samples, and what should have led to it from the block before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MomentumBlock {
    /// True when no block before it belongs to it.
    pub is_first: bool,
    /// s times the mean speed, in N/kN s.
    pub momentum: f64,
    /// Variance of `momentum` by the noise of the speed.
    pub momentum_variance: f64,
    /// From the mean of the block before to this one's: the integral of f, then what each
    /// unknown takes off it.
    pub impulse: Columns,
    /// Variance of the integral of f.
    pub impulse_variance: f64,
    /// Time of the newest sample in ns.
    pub time_ns: i64,
    /// Mean speed in m/s.
    pub speed_mps: f64,
}

/// Least-squares slope of the speed over a coasting segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoastingSegment {
    /// True when it shares its first half with no segment before it.
    pub is_first: bool,
    /// Resistance after known forces in N/kN, then the mean regressors with the slope's weights.
    pub row: Columns,
    /// The row of the segment before, which shares half of the samples; unused in the first.
    pub row_before: Columns,
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
pub enum Observation {
    /// From measured forces.
    Block(MomentumBlock),
    /// From coasting.
    Segment(CoastingSegment),
}

/// Half-overlapping slopes correlate by -1/4 (white noise, equal halves), which is a moving
/// average of new errors, `e_k + OVERLAP e_{k-1}`: OVERLAP / (1 + OVERLAP²) = -1/4.
const OVERLAP: f64 = -0.267_949_192_431_122_7;

impl Observation {
    /// True when nothing before it is connected with it.
    pub fn is_first(&self) -> bool {
        match self {
            Observation::Block(block) => block.is_first,
            Observation::Segment(segment) => segment.is_first,
        }
    }

    /// Time of the newest sample in ns.
    pub fn time_ns(&self) -> i64 {
        match self {
            Observation::Block(block) => block.time_ns,
            Observation::Segment(segment) => segment.time_ns,
        }
    }

    /// How the error moves to the first observation of a chain: momentum is new, and the
    /// disturbance has gone on for `gap_s`; unknown for how long when `None`. A block is used up
    /// by it.
    pub fn restart(
        &self,
        disturbance: &Disturbance,
        gap_s: Option<f64>,
    ) -> Propagation<STATES, COLUMNS> {
        match self {
            Observation::Block(block) => {
                disturbance.across_gap(gap_s, block.momentum, block.momentum_variance)
            }
            Observation::Segment(_) => disturbance.decay(gap_s.unwrap_or(f64::INFINITY)),
        }
    }

    /// How the error moves from the observation before to this one.
    pub fn propagation(&self, disturbance: &Disturbance) -> Propagation<STATES, COLUMNS> {
        match self {
            Observation::Block(block) => {
                disturbance.over_impulse(block.impulse[1], &block.impulse, block.impulse_variance)
            }
            Observation::Segment(segment) => {
                // The new error of the row before is that row less its other parts.
                let mut step: Propagation<STATES, COLUMNS> = disturbance.decay(segment.step_s);
                step.transition[(MOMENTUM, MOMENTUM)] = -OVERLAP;
                step.transition[(MOMENTUM, DISTURBANCE)] = -OVERLAP;
                step.input.set_row(MOMENTUM, &(segment.row_before * OVERLAP).transpose());
                step
            }
        }
    }

    /// What is seen of the error.
    pub fn sighting(&self) -> Sighting<STATES, COLUMNS> {
        match self {
            Observation::Block(block) => momentum_seen(block.momentum, block.momentum_variance),
            Observation::Segment(segment) => Sighting {
                direction: Vector2::new(1.0, 1.0),
                observed: segment.row,
                variance: segment.variance / (1.0 + OVERLAP * OVERLAP),
            },
        }
    }
}

/// Lets the disturbance have jumped, by so much in N/kN.
pub fn loosen_disturbance(whitener: &mut RowWhitener, std_n_per_kn: f64) {
    whitener.loosen(DISTURBANCE, std_n_per_kn * std_n_per_kn);
}

/// The motion now, from the errors' states in the middle of the newest block; `scale` is the
/// variance of the rows.
pub fn motion_of(
    whitener: &RowWhitener,
    since: &SinceBlock,
    disturbance: &Disturbance,
    scale: f64,
) -> Motion {
    let duration_s = since.impulse[1];
    let mut to_now = Matrix2::identity();
    to_now[(MOMENTUM, DISTURBANCE)] = -duration_s;
    let mut columns = to_now * whitener.state();
    for (column, impulse) in since.impulse.iter().enumerate() {
        columns[(MOMENTUM, column)] += impulse;
    }
    // A random walk of the disturbance, integrated twice.
    let walk = 2.0 * disturbance.std_n_per_kn.powi(2) / disturbance.time_s;
    let mut covariance = to_now * whitener.covariance() * to_now.transpose();
    covariance[(MOMENTUM, MOMENTUM)] += walk * duration_s.powi(3) / 3.0;
    covariance[(DISTURBANCE, DISTURBANCE)] += walk * duration_s;
    let to_speed = Matrix2::new(1.0 / since.inertia, 0.0, 0.0, 1.0);
    let columns = to_speed * columns;
    Motion {
        at_zero: columns.column(0).into_owned(),
        gain: -columns.fixed_columns::<UNKNOWNS>(1),
        covariance: to_speed * covariance * to_speed * scale,
    }
}

/// The disturbance in N/kN for given parameters, with its variance in units of the errors'.
pub fn disturbance_of(whitener: &RowWhitener, unknowns: &Unknowns) -> (f64, f64) {
    let columns = whitener.state().row(DISTURBANCE);
    let taken: f64 = (0..UNKNOWNS).map(|i| columns[i + 1] * unknowns[i]).sum();
    (columns[0] - taken, whitener.covariance()[(DISTURBANCE, DISTURBANCE)])
}
