//! Additional resistance at locations, on the part of the train there.

use dynocar_shared::vocabulary::EffectKind;

use super::{Parameter, Resistance, Suspect};
pub use crate::track::RESISTANCE as LIST;
use crate::track::{IntervalValue, StepProfile, TrackError, interval_profile};

/// A snow drift or a tight superelevation; a hundred N/kN is a steep hill.
pub const PARAMETERS: [Parameter; 1] = [Parameter::new("extra_n_per_kn", (0.0, 100.0), 0.02)];

/// The resistance of some disjoint intervals in m along the line.
///
/// # Errors
///
/// When intervals overlap, are reversed or not finite.
pub fn profile(intervals_m: &[[f64; 2]], extra_n_per_kn: f64) -> Result<StepProfile, TrackError> {
    let place =
        |&[start_m, end_m]: &[f64; 2]| IntervalValue { start_m, end_m, value: extra_n_per_kn };
    interval_profile(LIST, &intervals_m.iter().map(place).collect::<Vec<_>>())
}

/// Adds the resistance of a location.
#[inline]
pub fn act(extra_n_per_kn: f64, resistance: &mut Resistance) {
    resistance.place_n_per_kn += extra_n_per_kn;
}

/// Unit: the force that was found at the same place in earlier passes.
pub const SUSPECT: Suspect = Suspect {
    is_positive: true,
    ..Suspect::new(EffectKind::LocalResistance, 1.0, |seen| seen.earlier)
};
