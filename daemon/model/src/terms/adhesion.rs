//! A brake force that the rail does not carry: achieved = min(reported, mu · weight), or a share of the reported force.
//! It belongs to certain runs and is not declared in any file.

use dynocar_shared::vocabulary::EffectKind;

use super::{Least, Parameter, Suspect};

/// The cap mu of the first law.
pub const CAP: [Parameter; 1] = [Parameter::new("adhesion", (0.005, 0.5), 0.0005)];
/// The share of the second law.
pub const RATIO: [Parameter; 1] = [Parameter::new("achieved_ratio", (0.05, 1.0), 0.005)];
/// A brake that achieves more of its force is as good as declared.
pub const RATIO_LEAST: f64 = 0.97;
/// Standard deviation of the brake force computed from pressure and disc, as a share of it: few brakes exert it
/// exactly.
pub const DECLARED_BRAKE_STD: f64 = 0.05;

/// Returns the brake force in N that the rail carries.
#[inline]
pub fn carried_n(brake_n: f64, adhesion: f64, weight_n: f64) -> f64 {
    brake_n.min(adhesion * weight_n)
}

/// Unit: the share of the brake force that is missing.
pub const SUSPECT: Suspect = Suspect {
    is_positive: true,
    least: Least::Size(0.04),
    changes_at_stops: true,
    ..Suspect::new(EffectKind::LowAdhesion, 0.2, |seen| -seen.brake)
};
