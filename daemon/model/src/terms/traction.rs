//! A reported traction force that is not the true one: gain = reported over true.

use dynocar_shared::vocabulary::EffectKind;

use super::{Least, Parameter, Suspect};
pub use crate::train::numbers::TRACTION_GAIN as GAIN;

/// Beyond these bounds a controller reports another quantity.
pub const PARAMETERS: [Parameter; 1] = [Parameter::new("gain", (0.6, 1.6), 0.005)];
/// Accuracy of force sensors.
pub const LEAST: f64 = 0.01;

/// Standard deviation of the scale of a reported force.
pub const USUAL_STD: f64 = 0.007;

/// Returns the true force in N behind a reported one.
#[inline]
pub fn true_force_n(reported_n: f64, gain: f64) -> f64 {
    reported_n / gain
}

/// Unit: the share of the traction force that is missing.
pub const SUSPECT: Suspect = Suspect {
    least: Least::Size(0.02),
    ..Suspect::new(EffectKind::TractionGain, 0.06, |seen| seen.traction)
};
