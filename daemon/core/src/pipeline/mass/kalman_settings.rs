//! Settings of [`super::MassKalman`].

use serde::Deserialize;

use super::bias_bank::MODELS;
use super::bias_model::BiasModel;
use super::line_resistance::{DEFAULT_REFERENCE_RADIUS_M, LineResistance};
use super::within;
use crate::pipeline::settings::SettingError;
use crate::train::{Davis, TrainModel};

/// Settings of [`super::MassKalman`].
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MassKalmanSettings {
    /// Standard deviation of the declared mass in %.
    pub mass_std_percent: f64,
    /// Standard deviation in % of a change of mass at a stop; 0 when it never changes.
    pub mass_change_std_percent: f64,
    /// Shortest stop in s at which the mass may change.
    pub stop_min_s: f64,
    /// Standard deviation of the measured speed in m/s to start with; it is learned.
    pub speed_noise_mps: f64,
    /// Standard deviation in m/s² of an acceleration that the model lacks.
    pub bias_std_mps2: f64,
    /// Least force in N/kN that counts as traction or braking.
    pub force_min_n_per_kn: f64,
    /// Lowest speed in m/s that is used.
    pub speed_min_mps: f64,
    /// Basic resistance [a, b, c] in place of the declared one, speeds in m/s.
    pub basic_resistance: Option<[f64; 3]>,
    /// Curve resistance [a, b, c] at the reference radius beyond the declared one.
    pub curve_resistance: Option<[f64; 3]>,
    /// Tunnel resistance [a, b, c] beyond the declared one.
    pub tunnel_resistance: Option<[f64; 3]>,
    /// Radius in m that the curve resistance refers to.
    pub reference_radius_m: f64,
    /// Standard deviation of the mass in % up to which the estimate may be used.
    pub usable_std_percent: f64,
}

impl Default for MassKalmanSettings {
    fn default() -> Self {
        MassKalmanSettings {
            mass_std_percent: 20.0,
            mass_change_std_percent: 10.0,
            stop_min_s: 5.0,
            speed_noise_mps: 0.02,
            bias_std_mps2: 0.01,
            force_min_n_per_kn: 5.0,
            speed_min_mps: 1.0,
            basic_resistance: None,
            curve_resistance: None,
            tunnel_resistance: None,
            reference_radius_m: DEFAULT_REFERENCE_RADIUS_M,
            usable_std_percent: 2.0,
        }
    }
}

impl MassKalmanSettings {
    /// Refuses settings outside their ranges.
    ///
    /// # Errors
    ///
    /// Names key, value and range.
    pub fn check(&self) -> Result<(), SettingError> {
        within("mass_std_percent", self.mass_std_percent, (0.1, 50.0), "0.1 to 50")?;
        within("mass_change_std_percent", self.mass_change_std_percent, (0.0, 50.0), "0 to 50")?;
        within("stop_min_s", self.stop_min_s, (0.0, 3600.0), "0 to 3600")?;
        within("speed_noise_mps", self.speed_noise_mps, (1e-3, 1.0), "0.001 to 1")?;
        within("bias_std_mps2", self.bias_std_mps2, (1e-4, 0.5), "0.0001 to 0.5")?;
        within("force_min_n_per_kn", self.force_min_n_per_kn, (0.0, 100.0), "0 to 100")?;
        within("speed_min_mps", self.speed_min_mps, (0.3, 20.0), "0.3 to 20")?;
        within("reference_radius_m", self.reference_radius_m, (50.0, 1e4), "50 to 10000")?;
        within("usable_std_percent", self.usable_std_percent, (0.01, 50.0), "0.01 to 50")?;
        let polynomials = [
            ("basic_resistance", self.basic_resistance),
            ("curve_resistance", self.curve_resistance),
            ("tunnel_resistance", self.tunnel_resistance),
        ];
        for (key, polynomial) in polynomials {
            for coefficient in polynomial.unwrap_or_default() {
                within(key, coefficient, (-100.0, 100.0), "three numbers from -100 to 100")?;
            }
        }
        Ok(())
    }

    /// The resistance that the filters reckon with.
    pub fn line_resistance(&self, train: &TrainModel) -> LineResistance {
        let davis = |[a, b, c]: [f64; 3]| Davis { a, b, c };
        LineResistance {
            basic: self.basic_resistance.map_or(train.resistance, davis),
            curve: self.curve_resistance.map(davis),
            tunnel: self.tunnel_resistance.map(davis),
            reference_radius_m: self.reference_radius_m,
        }
    }

    /// Takes a learned resistance in place of the declared one.
    #[must_use]
    pub fn with_resistance(mut self, resistance: &LineResistance) -> Self {
        let list = |davis: Davis| [davis.a, davis.b, davis.c];
        self.basic_resistance = Some(list(resistance.basic));
        self.curve_resistance = resistance.curve.map(list);
        self.tunnel_resistance = resistance.tunnel.map(list);
        self.reference_radius_m = resistance.reference_radius_m;
        self
    }

    /// The behaviours of the bias: none; constant; constant and slow in proportion to speed;
    /// small and large, each slow and gusty.
    pub fn bias_models(&self) -> [BiasModel; MODELS] {
        let model =
            |share: f64, time_s, grows| BiasModel::new(share * self.bias_std_mps2, time_s, grows);
        [
            model(1e-3, f64::INFINITY, false),
            model(1.0, f64::INFINITY, false),
            model(1.0, f64::INFINITY, true),
            model(1.0, 60.0, true),
            model(0.3, 60.0, false),
            model(0.3, 10.0, false),
            model(1.0, 60.0, false),
            model(1.0, 10.0, false),
        ]
    }
}
