//! What is declared, and how far from it everything usually is.

use dynocar_model::train::TrainModel;

use super::information::BaseVector;
use super::settings::MonitorSettings;
use super::suspects::{CURVE, DAY_WIND, LOAD, WARMING};
use crate::pipeline::momentum::settings::DataSettings;
use crate::pipeline::momentum::{
    BRAKE_SCALE, FORCE_DELAY, SPEED_SCALE_MPS, TRACTION_SCALE, scaled,
};
use crate::pipeline::settings::{SettingError, require};

/// Standard deviation of a curve constant of which nothing is declared, in 1000 N/kN m.
const CURVE_STD_MIN: f64 = 0.02;

/// The base model before the rows.
pub struct Usual {
    /// The declared a, b, c, scaled, as base parameters.
    pub declared_base: BaseVector,
    /// Standard deviations of what each base parameter lacks.
    pub base_std: BaseVector,
}

impl Usual {
    /// That of a train.
    ///
    /// # Errors
    ///
    /// When the scale of the forces is given at two places.
    pub fn of(settings: &MonitorSettings, train: &TrainModel) -> Result<Self, SettingError> {
        let force_scale_std = settings.data.force_scale_std;
        require(
            force_scale_std == DataSettings::default().force_scale_std,
            "data.force_scale_std",
            force_scale_std,
            "no value here: force_std_percent says it",
        )?;
        let declared = train.resistance;
        let coefficients = scaled(&declared);
        let mut declared_base = BaseVector::zeros();
        let mut base_std = BaseVector::zeros();
        for i in 0..coefficients.len() {
            declared_base[i] = coefficients[i];
            let least = 0.01 * declared.w0_n_per_kn(10.0).max(0.1);
            base_std[i] = (settings.davis_std_share * coefficients[i].abs()).max(least);
        }
        base_std[TRACTION_SCALE] = 0.01 * settings.force_std_percent;
        base_std[BRAKE_SCALE] = 0.01 * settings.force_std_percent;
        base_std[FORCE_DELAY] = settings.data.force_delay_std_s;
        base_std[LOAD] = 0.01 * settings.mass_std_percent;
        base_std[DAY_WIND] = settings.wind_std_mps;
        let curve = settings.curve_constant_std * 1e-3 * train.curve_constant_n_per_kn_m;
        base_std[CURVE] = curve.max(CURVE_STD_MIN);
        let over_a = declared.w0_n_per_kn(SPEED_SCALE_MPS) / declared.a.max(0.1);
        base_std[WARMING] = settings.warming_std * over_a;
        Ok(Usual { declared_base, base_std })
    }
}
