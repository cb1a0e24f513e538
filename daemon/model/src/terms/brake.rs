//! A brake that exerts another force than it reports, and one that does not release: a force that builds up from some
//! instant on, belongs to certain runs and is not declared in any file.

use dynocar_shared::vocabulary::EffectKind;

use super::{Parameter, Suspect, adhesion};
pub use crate::train::numbers::BRAKE_GAIN as GAIN;

/// A brake whose force is nearer to its report is as good as declared.
pub const GAIN_LEAST: f64 = adhesion::DECLARED_BRAKE_STD;

/// Standard deviation of the scale of a reported brake force, from train to train.
pub const USUAL_STD: f64 = 0.02;
/// Time constant in s of the slowest brake that needs no setting of its own.
pub const SLOWEST_S: f64 = 1.5;

/// The force builds up over this time in s.
pub const BUILD_UP_S: f64 = 10.0;
/// The dragging force.
pub const PARAMETERS: [Parameter; 1] = [Parameter::new("force_n", (0.0, 3e5), 20.0)];

/// Returns the share of the force `since_s` seconds after the onset.
#[inline]
pub fn build_up(since_s: f64) -> f64 {
    (since_s / BUILD_UP_S).clamp(0.0, 1.0)
}

/// Unit: 1 N/kN.
pub const SUSPECT: Suspect =
    Suspect { is_positive: true, ..Suspect::new(EffectKind::DraggingBrake, 1.5, |_| 1.0) };
