//! What every estimator takes from the samples of a moving train.
//!
//! - [`STANDING_MPS`], [`MOVING_MPS`], [`BRIDGED_MAX_S`]: when a train stands, moves, and is lost sight of
//! - [`Trust`], [`OutlierRow`]: how far a measured speed is believed
//! - [`jump_variance`], [`kink_variance`]: what a trapezoid over a step misses
//! - [`Rounding`], [`SpeedNoise`]: the steps that a speed is reported in, and its noise
//! - [`PositionNoise`]: the noise of a measured position
//! - [`SpeedRange`]: the speeds driven
//! - [`StopWatch`], [`is_same_mass`]: when the mass may have changed

mod missed;
mod outlier;
mod position_noise;
mod rounding;
mod speed_noise;
mod speed_range;
mod stop_watch;

pub use missed::{jump_variance, kink_variance};
pub use outlier::{OutlierRow, Trust};
pub use position_noise::PositionNoise;
pub use rounding::Rounding;
pub use speed_noise::SpeedNoise;
pub use speed_range::SpeedRange;
pub use stop_watch::{StopWatch, is_same_mass};

pub use dynocar_model::terms::wheel::STANDING_MPS;

/// Speed in m/s up to which nothing is learned of a train's motion: holding brakes, slack and starting
/// resistance are no part of the model.
pub const MOVING_MPS: f64 = 1.0;
/// The longest time in s between two samples that is integrated over, as in validation: missing forces
/// are bridged by the mean of those around them, and records at 1 Hz are used.
pub const BRIDGED_MAX_S: f64 = 2.5;
