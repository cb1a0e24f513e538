//! Momentum against the impulse of the forces: what every estimator of resistance learns from.
//!
//! In momentum per weight, with s = 1000 (1 + gamma) / g, the declared model reads
//! `s dv/dt = f(t) - w0(v)`, f being the driving force in N per kN of weight (Liu 2018, eq. 5,
//! whose printed factor 100 lacks rotating mass and rounds 1000/g). It is linear in Davis a, b
//! and c whatever window it is integrated over.
//!
//! - [`sample`]: forces per weight; spikes refused, noise of the speed learned
//! - [`blocks`]: samples to blocks, the impulse between them, and what each unknown takes off it
//! - [`error`]: what a small unknown force leaves of one block's momentum in the next
//! - [`settings`]: how samples become such data

pub mod blocks;
pub mod error;
pub mod sample;
pub mod settings;

use dynocar_model::train::Davis;
use nalgebra::{SVector, Vector3};

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
