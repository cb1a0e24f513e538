//! The gradient under the train, a profile that lies elsewhere than the map shows, and one that is wrong by a smooth
//! function of the chainage, with opposite forces in the two directions.

use dynocar_shared::vocabulary::EffectKind;

use super::{Parameter, Suspect};
use crate::track::{GradientError, Track};

/// The number of `[track]` by which the true profile is shifted against the map, towards growing chainage.
pub const SHIFT: &str = "gradient_shift_m";
/// Greatest shift in m: more than a wrong kilometre post.
pub const SHIFT_MAX_M: f64 = 1600.0;
/// The shift.
pub const SHIFT_PARAMETERS: [Parameter; 1] =
    [Parameter::new("shift_m", (-SHIFT_MAX_M, SHIFT_MAX_M), 2.0)];
/// Accuracy in m of a surveyor's chainage.
pub const SHIFT_LEAST_M: f64 = 5.0;

/// The list of `[track]` that holds [chainage in m, permille]: the error of the declared gradient.
pub const ERROR: &str = "gradient_error";
/// The same for falling chainage, where the error differs; without it, both directions have the same error.
pub const ERROR_FALLING: &str = "gradient_error_falling";
/// Error of the gradient at one chainage.
pub const ERROR_PARAMETER: Parameter = Parameter::new("permille", (-150.0, 150.0), 0.05);
/// A root mean square in ‰ below this is within the difference of good surveys.
pub const ERROR_LEAST_PERMILLE: f64 = 0.25;

/// Standard deviation of the scale of gradients that an accelerometer feels: the pitch of a body that accelerates,
/// the sensor's scale and its noise all change how much of a gradient is seen.
pub const FELT_USUAL_STD: f64 = 0.2;

/// Adds an error of the gradient, in ‰ along growing chainage, to the gradient along the travel.
#[inline]
pub fn err(error: &GradientError, (position_m, direction): (f64, f64), permille: &mut f64) {
    *permille += direction * error.at(position_m, direction);
}

/// Returns the gradient in ‰ along the travel under a train of a length in m, whose profile is moved by `shift_m`
/// beyond the declared line.
#[inline]
pub fn along_travel_permille(
    track: &Track,
    (position_m, direction): (f64, f64),
    length_m: f64,
    shift_m: f64,
) -> Option<f64> {
    let at_m = position_m - shift_m;
    Some(direction * track.gradient_towards_permille(direction, at_m, length_m)?)
}

/// Unit: the error of the gradient that was found at the same place in earlier passes.
pub const SUSPECT: Suspect = Suspect {
    is_positive: true,
    ..Suspect::new(EffectKind::GradientError, 1.0, |seen| seen.earlier_uphill)
};
