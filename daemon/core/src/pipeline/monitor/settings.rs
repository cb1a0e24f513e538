//! Settings of the residual monitor.

use serde::Deserialize;

use crate::pipeline::resistance::settings::DataSettings;
use crate::pipeline::settings::{SettingError, require};

/// Settings of `residual_monitor`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MonitorSettings {
    /// Evidence, less what the search costs, from which a suspect is named.
    pub evidence_min: f64,
    /// Share of the resistance below which an unexplained force is no matter.
    pub share_min: f64,
    /// Standard deviation of each declared Davis coefficient, as a share of it.
    pub davis_std_share: f64,
    /// Small slow forces that are no effect (wind, survey of the gradient): standard deviation
    /// in N/kN.
    pub disturbance_n_per_kn: f64,
    /// The same as a share of the resistance; both count.
    pub disturbance_share: f64,
    /// How long such a force lasts, in s.
    pub disturbance_time_s: f64,
    /// Time of motion in h over which evidence is forgotten.
    pub memory_h: f64,
    /// How samples become regression data; the source is always momentum.
    pub data: DataSettings,
}

impl Default for MonitorSettings {
    fn default() -> Self {
        MonitorSettings {
            evidence_min: 25.0,
            share_min: 0.08,
            davis_std_share: 0.1,
            disturbance_n_per_kn: 0.05,
            disturbance_share: 0.03,
            disturbance_time_s: 60.0,
            memory_h: 4.0,
            data: DataSettings::default(),
        }
    }
}

impl MonitorSettings {
    /// Checks every range.
    ///
    /// # Errors
    ///
    /// Names the setting, its value and the allowed range.
    pub fn check(&self) -> Result<(), SettingError> {
        let within = |key, value: f64, low: f64, high: f64, allowed| {
            require((low..=high).contains(&value), key, value, allowed)
        };
        within("evidence_min", self.evidence_min, 1.0, 1e6, "1 to 1e6")?;
        within("share_min", self.share_min, 0.0, 1.0, "0 to 1")?;
        within("davis_std_share", self.davis_std_share, 1e-3, 1.0, "0.001 to 1")?;
        let std = self.disturbance_n_per_kn;
        within("disturbance_n_per_kn", std, 1e-3, 10.0, "0.001 to 10 N/kN")?;
        within("disturbance_share", self.disturbance_share, 0.0, 1.0, "0 to 1")?;
        within("disturbance_time_s", self.disturbance_time_s, 1.0, 1e4, "1 to 10000 s")?;
        within("memory_h", self.memory_h, 0.1, 1e4, "0.1 to 10000 h")?;
        self.data.check()
    }
}
