//! Curve resistance k/R (Röckl, Schmidt).

use dynocar_shared::vocabulary::EffectKind;

use super::{Parameter, Resistance, Suspect};
pub use crate::train::numbers::CURVE_CONSTANT as CONSTANT;

/// The total k lies between 0 and about eight times the usual value.
pub const PARAMETERS: [Parameter; 1] = [Parameter::new("k_n_per_kn_m", (0.0, 5000.0), 20.0)];
/// A k that differs by less from the declared one is within the spread of the usual formulas.
pub const LEAST_N_PER_KN_M: f64 = 100.0;

/// Standard deviation of a declared k, as a share of it: formulas differ.
pub const USUAL_STD: f64 = 0.2;

/// Curves of a mean 1/R along the train resist.
#[inline]
pub fn act(k_n_per_kn_m: f64, curvature_per_m: Option<f64>, resistance: &mut Resistance) {
    resistance.curve_n_per_kn = k_n_per_kn_m * curvature_per_m.unwrap_or(0.0);
}

/// Unit: 1000 N/kN m of k.
pub const SUSPECT: Suspect = Suspect::new(EffectKind::CurveResistance, 0.7, |seen| {
    let mut curves = Resistance::BASIC;
    act(1000.0, seen.curvature_per_m, &mut curves);
    curves.curve_n_per_kn
});
