//! Settings of [`super::JointLeastSquares`].

use serde::Deserialize;

use super::bias_model::BiasModel;
use super::line_resistance::DEFAULT_REFERENCE_RADIUS_M;
use super::within;
use crate::pipeline::settings::SettingError;

/// Number of behaviours of the unexplained acceleration.
pub const JOINT_MODELS: usize = 6;

/// Settings of [`super::JointLeastSquares`].
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct JointLeastSquaresSettings {
    /// Standard deviation of the declared mass in %.
    pub mass_std_percent: f64,
    /// Standard deviation in % of a change of mass at a stop; 0 when it never changes.
    pub mass_change_std_percent: f64,
    /// Shortest stop in s at which the mass may change.
    pub stop_min_s: f64,
    /// Standard deviation in N/kN of the declared resistances.
    pub resistance_std_n_per_kn: f64,
    /// Standard deviation of the measured speed in m/s to start with; it is learned.
    pub speed_noise_mps: f64,
    /// Standard deviation in m/s² of an acceleration that no parameter explains.
    pub bias_std_mps2: f64,
    /// Lowest speed in m/s that is used.
    pub speed_min_mps: f64,
    /// Radius in m that the curve resistance refers to.
    pub reference_radius_m: f64,
    /// Standard deviation of the mass in % up to which it may be used.
    pub usable_std_percent: f64,
    /// Standard deviation in N/kN of the basic resistance up to which it may be used.
    pub usable_std_n_per_kn: f64,
}

impl Default for JointLeastSquaresSettings {
    fn default() -> Self {
        JointLeastSquaresSettings {
            mass_std_percent: 20.0,
            mass_change_std_percent: 10.0,
            stop_min_s: 5.0,
            resistance_std_n_per_kn: 5.0,
            speed_noise_mps: 0.02,
            bias_std_mps2: 0.01,
            speed_min_mps: 1.0,
            reference_radius_m: DEFAULT_REFERENCE_RADIUS_M,
            usable_std_percent: 2.0,
            usable_std_n_per_kn: 0.3,
        }
    }
}

impl JointLeastSquaresSettings {
    /// Refuses settings outside their ranges.
    ///
    /// # Errors
    ///
    /// Names key, value and range.
    pub fn check(&self) -> Result<(), SettingError> {
        within("mass_std_percent", self.mass_std_percent, (1e-4, 50.0), "0.0001 to 50")?;
        within("mass_change_std_percent", self.mass_change_std_percent, (0.0, 50.0), "0 to 50")?;
        within("stop_min_s", self.stop_min_s, (0.0, 3600.0), "0 to 3600")?;
        within(
            "resistance_std_n_per_kn",
            self.resistance_std_n_per_kn,
            (1e-3, 100.0),
            "0.001 to 100",
        )?;
        within("speed_noise_mps", self.speed_noise_mps, (1e-3, 1.0), "0.001 to 1")?;
        within("bias_std_mps2", self.bias_std_mps2, (1e-4, 0.5), "0.0001 to 0.5")?;
        within("speed_min_mps", self.speed_min_mps, (0.3, 20.0), "0.3 to 20")?;
        within("reference_radius_m", self.reference_radius_m, (50.0, 1e4), "50 to 10000")?;
        within("usable_std_percent", self.usable_std_percent, (0.01, 50.0), "0.01 to 50")?;
        within("usable_std_n_per_kn", self.usable_std_n_per_kn, (1e-3, 10.0), "0.001 to 10")
    }

    /// The behaviours of the unexplained acceleration: none; slow in proportion to speed; small
    /// and large, each slow and gusty. A constant is z1's to explain.
    pub fn bias_models(&self) -> [BiasModel; JOINT_MODELS] {
        let model =
            |share: f64, time_s, grows| BiasModel::new(share * self.bias_std_mps2, time_s, grows);
        [
            model(1e-3, f64::INFINITY, false),
            model(1.0, 60.0, true),
            model(0.3, 60.0, false),
            model(0.3, 10.0, false),
            model(1.0, 60.0, false),
            model(1.0, 10.0, false),
        ]
    }
}
