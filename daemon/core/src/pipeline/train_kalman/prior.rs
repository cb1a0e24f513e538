//! What is believed before the first sample.

use dynocar_model::train::Davis;
use nalgebra::{Matrix3, Vector3};

use super::bank::MotionBank;
use super::motion_filter::{
    BRAKE_SCALE, COEFFICIENTS, FORCE_DELAY, LOAD, RESISTANCE, SPEED, State, StateCovariance,
    TRACTION_SCALE, WIND,
};
use super::settings::TrainKalmanSettings;
use crate::pipeline::momentum::{regressors, scaled, unscaling};

/// No declared coefficient is taken for known better than one that makes this share of w0 at 20 m/s: a
/// declared zero is no knowledge.
const FLOOR_SHARE: f64 = 0.2;

/// a, b, c (scaled, N/kN) with their covariance, declared or kept from earlier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resistance {
    mean: Vector3<f64>,
    covariance: Matrix3<f64>,
}

impl Resistance {
    /// As declared, each coefficient to a share of itself.
    pub fn declared(davis: &Davis, relative_std: f64) -> Self {
        let mean = scaled(davis);
        let floor = FLOOR_SHARE * davis.w0_n_per_kn(20.0).abs();
        let stds = mean.map(|value| relative_std * value.abs().max(floor));
        Resistance { mean, covariance: Matrix3::from_diagonal(&stds.component_mul(&stds)) }
    }

    /// Standard deviation of a in N/kN.
    pub fn a_std(&self) -> f64 {
        self.covariance[(0, 0)].sqrt()
    }

    /// As kept from earlier: Davis a, b, c and their covariance.
    pub fn kept(davis: &Vector3<f64>, covariance: &Matrix3<f64>) -> Self {
        let scale = Matrix3::from_diagonal(&unscaling().map(|factor| 1.0 / factor));
        Resistance { mean: scale * davis, covariance: scale * covariance * scale }
    }

    /// c, scaled.
    pub fn air_resistance(&self) -> f64 {
        self.mean[2]
    }

    /// What a headwind of 1 m/s adds at a speed in m/s, in N/kN.
    pub fn by_wind(&self, speed_mps: f64) -> f64 {
        let square = |mps: f64| regressors(mps)[2];
        0.5 * self.mean[2] * (square(speed_mps + 1.0) - square(speed_mps - 1.0))
    }

    /// What the square of a wind of 1 m/s adds, in N/kN.
    pub fn by_wind_square(&self) -> f64 {
        self.mean[2] * regressors(1.0)[2]
    }

    /// Filters that believe this, and forces and load as the settings trust them.
    pub fn bank(&self, settings: &TrainKalmanSettings) -> MotionBank {
        let mut mean = State::zeros();
        mean[LOAD] = 1.0;
        mean.fixed_rows_mut::<COEFFICIENTS>(RESISTANCE).copy_from(&self.mean);
        let mut all = StateCovariance::zeros();
        all[(SPEED, SPEED)] = 1.0;
        all[(LOAD, LOAD)] = (0.01 * settings.load_std_percent).powi(2);
        all.fixed_view_mut::<COEFFICIENTS, COEFFICIENTS>(RESISTANCE, RESISTANCE)
            .copy_from(&self.covariance);
        all[(TRACTION_SCALE, TRACTION_SCALE)] = settings.force_scale_std.powi(2);
        all[(BRAKE_SCALE, BRAKE_SCALE)] = settings.brake_scale_std.powi(2);
        all[(FORCE_DELAY, FORCE_DELAY)] = settings.force_delay_std_s.powi(2);
        all[(WIND, WIND)] = settings.wind_std_mps.powi(2);
        MotionBank::new(&mean, &all)
    }
}
