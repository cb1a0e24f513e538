//! Basic resistance that follows the outside temperature: w0 (1 + beta (T - reference)).
//!
//! A sample without temperature takes that of the last sample with one; before the first temperature nothing is
//! corrected.

use dynocar_shared::vocabulary::EffectKind;

use crate::train::Corrections;

use super::{Least, Parameter, Resistance, Suspect};
pub use crate::train::numbers::{AMBIENT_REFERENCE as REFERENCE, AMBIENT_W0 as W0_PER_K};

/// 0 °C in K.
const ZERO_DEGC_K: f64 = 273.15;
/// The standard atmosphere's 15 °C in K, for which coefficients are declared.
pub const REFERENCE_K: f64 = Corrections::NONE.ambient_reference_k;

/// Air density alone gives -0.0035 per kelvin; cold grease adds to it.
pub const PARAMETERS: [Parameter; 1] = [Parameter::new("w0_per_k", (-0.05, 0.05), 0.0005)];
/// A smaller change per kelvin does not matter over the temperatures of a year.
pub const LEAST_PER_K: f64 = 0.001;

/// Returns how much warmer than a reference in K it is outside, in K.
#[inline]
pub fn warmer_k(degc: Option<f64>, reference_k: f64) -> f64 {
    degc.map_or(0.0, |degc| degc + ZERO_DEGC_K - reference_k)
}

/// The basic resistance changes with the temperature.
#[inline]
pub fn act(w0_per_k: f64, reference_k: f64, degc: Option<f64>, resistance: &mut Resistance) {
    resistance.factor *= 1.0 + w0_per_k * warmer_k(degc, reference_k);
}

/// Unit: the share of w0 added for 10 K more.
pub const SUSPECT: Suspect = Suspect {
    least: Least::Share(0.7),
    ..Suspect::new(EffectKind::AmbientTemperature, 0.1, |seen| {
        let mut warm = Resistance::BASIC;
        act(0.1, REFERENCE_K, seen.ambient_temperature_degc, &mut warm);
        warm.extra_n_per_kn(seen.davis, seen.speed_mps)
    })
};
