//! The gradient under the train, and a profile that lies elsewhere than the map says.

use super::Parameter;
use crate::track::Track;

/// The number of `[track]` by which the true profile is the map's moved towards growing chainage.
pub const SHIFT: &str = "gradient_shift_m";
/// Greatest shift in m: more than a wrong kilometre post.
pub const SHIFT_MAX_M: f64 = 1600.0;
/// The shift.
pub const SHIFT_PARAMETERS: [Parameter; 1] =
    [Parameter::new("shift_m", (-SHIFT_MAX_M, SHIFT_MAX_M), 2.0)];
/// A surveyor's chainage is good to this in m.
pub const SHIFT_LEAST_M: f64 = 5.0;

/// Gradient in ‰ along the travel under a train of a length in m, whose profile is moved by
/// `shift_m` beyond what the line declares.
#[inline]
pub fn along_travel_permille(
    track: &Track,
    (position_m, direction): (f64, f64),
    length_m: f64,
    shift_m: f64,
) -> Option<f64> {
    Some(direction * track.gradient_permille(position_m - shift_m, length_m)?)
}
