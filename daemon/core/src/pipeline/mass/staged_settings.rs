//! Settings of [`super::StagedDescent`].

use serde::Deserialize;

use super::line_resistance::DEFAULT_REFERENCE_RADIUS_M;
use super::within;
use crate::pipeline::settings::SettingError;

/// What the mass is fitted on; the paper does not say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MassRegression {
    /// Force on the differentiated speed. Its noise is in the regressor and pulls the mass down:
    /// the shortfall that Table 3 shows.
    #[default]
    ForceOnAcceleration,
    /// The differentiated speed on force, as eq. (27) has it: unbiased.
    AccelerationOnForce,
}

/// Settings of [`super::StagedDescent`].
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StagedDescentSettings {
    /// What the mass is fitted on.
    pub mass_regression: MassRegression,
    /// Samples of the first stages, driven at the declared mass; the mass is learned after.
    pub resistance_samples: u64,
    /// Steps down the gradient with each sample.
    pub steps_per_sample: u32,
    /// Length of a step relative to the inverse trace of the second derivative.
    pub rate: f64,
    /// Shortest stop in s at which the mass may change.
    pub stop_min_s: f64,
    /// Lowest speed in m/s that is used.
    pub speed_min_mps: f64,
    /// Least force in N/kN on which mass is learned.
    pub force_min_n_per_kn: f64,
    /// Radius in m that the curve resistance refers to.
    pub reference_radius_m: f64,
}

impl Default for StagedDescentSettings {
    fn default() -> Self {
        StagedDescentSettings {
            mass_regression: MassRegression::ForceOnAcceleration,
            resistance_samples: 28_000,
            steps_per_sample: 4,
            rate: 1.0,
            stop_min_s: 5.0,
            speed_min_mps: 1.0,
            force_min_n_per_kn: 5.0,
            reference_radius_m: DEFAULT_REFERENCE_RADIUS_M,
        }
    }
}

impl StagedDescentSettings {
    /// Refuses settings outside their ranges.
    ///
    /// # Errors
    ///
    /// Names key, value and range.
    pub fn check(&self) -> Result<(), SettingError> {
        let samples = self.resistance_samples as f64;
        within("resistance_samples", samples, (0.0, 1e9), "0 to 1000000000")?;
        within("steps_per_sample", f64::from(self.steps_per_sample), (1.0, 100.0), "1 to 100")?;
        within("rate", self.rate, (1e-3, 1.9), "0.001 to 1.9")?;
        within("stop_min_s", self.stop_min_s, (0.0, 3600.0), "0 to 3600")?;
        within("speed_min_mps", self.speed_min_mps, (0.3, 20.0), "0.3 to 20")?;
        within("force_min_n_per_kn", self.force_min_n_per_kn, (0.0, 100.0), "0 to 100")?;
        within("reference_radius_m", self.reference_radius_m, (50.0, 1e4), "50 to 10000")
    }
}
