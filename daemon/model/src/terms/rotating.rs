//! Rotating parts: inertial mass = mass (1 + gamma). Unlike other mass they add no weight.

use dynocar_shared::vocabulary::EffectKind;

use super::{Least, Parameter, Suspect};
pub use crate::train::numbers::ROTATING_MASS_FACTOR as FACTOR;

/// Locomotives with small loads reach 0.25 to 0.3.
pub const PARAMETERS: [Parameter; 1] = [Parameter::new("rotating_mass_factor", (0.0, 0.5), 0.005)];
/// Least difference of the factor that counts as an effect; a load changes it by less.
pub const LEAST: f64 = 0.01;
/// Standard deviation of the declared factor, which is taken from a table of similar trains and seldom measured.
pub const USUAL_STD: f64 = 0.01;

/// Inertial mass in kg.
#[inline]
pub fn inertial_mass_kg(mass_kg: f64, factor: f64) -> f64 {
    mass_kg * (1.0 + factor)
}

/// The monitor's suspect; its unit is an addition to gamma.
pub const SUSPECT: Suspect = Suspect {
    least: Least::Size(0.02),
    ..Suspect::new(EffectKind::RotatingMass, 0.05, |seen| {
        seen.driving - seen.davis.w0_n_per_kn(seen.speed_mps)
    })
};
