//! Mass, and the resistances that have to be known for it (Wang 2022).
//!
//! - [`MassKalman`]: Kalman filters [v, 1/m, bias]

pub mod bias_bank;
mod health;
mod joint;
mod kalman;
mod kalman_settings;
pub mod line_resistance;
pub mod motion;
pub mod speed_basis;

pub use joint::{JointLeastSquares, JointLeastSquaresSettings};
pub use kalman::MassKalman;
pub use kalman_settings::MassKalmanSettings;

use super::settings::{SettingError, require};

/// Refuses a setting that is not finite or lies outside its range.
fn within(
    key: &'static str,
    value: f64,
    (low, high): (f64, f64),
    allowed: &'static str,
) -> Result<(), SettingError> {
    require((low..=high).contains(&value), key, value, allowed)
}
