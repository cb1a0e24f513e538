//! Wheels of another diameter than declared: measured speed = scale · true speed.

use super::Parameter;
pub use crate::train::numbers::SPEED_SCALE;

/// Up to this speed in m/s a train stands; below it a wheel sensor sees nothing.
pub const STANDING_MPS: f64 = 0.3;
/// A recorded speed in m/s below which a vehicle surely stands, however it was measured.
pub const STILL_MPS: f64 = 0.1;
/// Wheels are turned down by at most about a tenth of their diameter.
pub const PARAMETERS: [Parameter; 1] = [Parameter::new("speed_scale", (0.88, 1.12), 0.002)];
/// Least effect; the wear of a wheel between two measurements is less.
pub const LEAST: f64 = 0.003;

/// Returns the true speed in m/s behind a measured one.
#[inline]
pub fn true_speed_mps(measured_mps: f64, speed_scale: f64) -> f64 {
    measured_mps / speed_scale
}
