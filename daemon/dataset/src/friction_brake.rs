//! The friction brake in a `train.toml`: its force by the pressure, and how its units differ and fail.

use dynocar_model::train::{BrakeComponents, FrictionBrake};

use super::document::Item;
use super::error::DatasetError;

/// A friction brake is released up to this pressure in Pa unless a train says otherwise.
const RELEASE_PRESSURE_DEFAULT_PA: f64 = 20e3;
/// Relative standard deviations of what a brake's units differ in.
pub(super) const UNIT_STDS: [&str; 5] =
    ["friction_std", "pressure_std", "efficiency_std", "common_std", "mass_std"];

/// The friction brake that is known by its pressure.
pub(super) fn friction_brake(section: &Item) -> Result<Option<FrictionBrake>, DatasetError> {
    let gain = section.optional("force_per_pressure_n_per_pa", "N/Pa from 0 to 1000", 0.0..=1e3)?;
    let release =
        section.optional("release_pressure_pa", "a pressure in Pa from 0 to 1e6", 0.0..=1e6)?;
    Ok(gain.map(|force_per_pressure_n_per_pa| FrictionBrake {
        force_per_pressure_n_per_pa,
        release_pressure_pa: release.unwrap_or(RELEASE_PRESSURE_DEFAULT_PA),
    }))
}

/// How the brake's units differ and fail.
pub(super) fn components(section: &Item) -> Result<Option<BrakeComponents>, DatasetError> {
    if !["units", "failure_probability"].iter().chain(&UNIT_STDS).any(|key| section.has(key)) {
        return Ok(None);
    }
    let units = section.required("units", "a number of units from 1 to 10000", 1.0..=1e4)? as u32;
    let failure =
        section.optional("failure_probability", "a probability from 0 to 0.5", 0.0..=0.5)?;
    let mut stds = [0.0; UNIT_STDS.len()];
    for (std, key) in stds.iter_mut().zip(UNIT_STDS) {
        let given =
            section.optional(key, "a relative standard deviation from 0 to 0.5", 0.0..=0.5)?;
        *std = given.unwrap_or(0.0);
    }
    let [friction_std, pressure_std, efficiency_std, common_std, mass_std] = stds;
    let found = BrakeComponents {
        units,
        friction_std,
        pressure_std,
        efficiency_std,
        common_std,
        mass_std,
        failure_probability: failure.unwrap_or(0.0),
    };
    Ok(Some(found))
}
