//! Settings of `trajectory_newton`.

use nalgebra::Vector3;
use serde::Deserialize;

use super::fit::DavisPrior;
use super::quality::prior_std;
use super::step::resistance_gain;
use crate::filter::levenberg_marquardt::ParameterBox;
use crate::pipeline::settings::{SettingError, require};
use crate::train::TrainModel;

/// Speed noise before the first window, in m/s.
const SPEED_NOISE_FIRST_MPS: f64 = 0.1;

/// How a window is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FitMethod {
    /// Box-constrained least squares with free initial speed and a prior; steps in time.
    LevenbergMarquardt,
    /// Algorithm 1 of the paper: Newton, Wolfe steps, restarts; steps by eq. 7.
    WolfeNewton,
}

/// Settings of `trajectory_newton`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrajectoryNewtonSettings {
    /// How a window is fitted.
    pub method: FitMethod,
    /// Steps of a window, the data capacity I of the paper.
    pub window: u32,
    /// Distance in m between points.
    pub interval_m: f64,
    /// Standard deviations of the declared coefficients, as a share of each; they bind what a
    /// window does not tell.
    pub prior_relative_std: f64,
    /// Standard deviation of the measured speed in m/s; learned from the residuals when absent.
    pub speed_noise_mps: Option<f64>,
    /// Root of the density of disturbing forces in N/kN √s, for `levenberg_marquardt`; 0 fits
    /// the whole trajectory as the paper does.
    pub disturbance_n_per_kn_sqrt_s: f64,
    /// Lowest a, b, c; 0 when absent. Table 2 of the paper has 0.4, 0, 0.
    pub low: Option<[f64; 3]>,
    /// Highest a, b, c; five prior standard deviations above the declared when absent. Table 2
    /// of the paper has 3, 0.2, 0.01.
    pub high: Option<[f64; 3]>,
    /// ε1 of eq. 25 in (m/s)², for `wolfe_newton`.
    pub mean_square_max: f64,
    /// Seed of the restarts, for `wolfe_newton`.
    pub seed: u64,
}

impl Default for TrajectoryNewtonSettings {
    fn default() -> Self {
        TrajectoryNewtonSettings {
            method: FitMethod::LevenbergMarquardt,
            window: 20,
            interval_m: 100.0,
            prior_relative_std: 0.5,
            speed_noise_mps: None,
            disturbance_n_per_kn_sqrt_s: 0.2,
            low: None,
            high: None,
            mean_square_max: 0.05,
            seed: 1,
        }
    }
}

impl TrajectoryNewtonSettings {
    /// The settings for a train, in the estimator's units.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub(super) fn checked(&self, train: &TrainModel) -> Result<CheckedSettings, SettingError> {
        let positive = "a finite number above 0";
        let is_positive = |value: f64| value > 0.0 && value.is_finite();
        let window = f64::from(self.window);
        require((5.0..=5000.0).contains(&window), "window", window, "5 to 5000 steps")?;
        let interval_m = self.interval_m;
        require((1.0..=1e4).contains(&interval_m), "interval_m", interval_m, "1 to 10000 m")?;
        let relative = self.prior_relative_std;
        require(is_positive(relative), "prior_relative_std", relative, positive)?;
        let noise_mps = self.speed_noise_mps.unwrap_or(SPEED_NOISE_FIRST_MPS);
        require(is_positive(noise_mps), "speed_noise_mps", noise_mps, positive)?;
        let disturbance = self.disturbance_n_per_kn_sqrt_s;
        let is_allowed = disturbance >= 0.0 && disturbance.is_finite();
        let key = "disturbance_n_per_kn_sqrt_s";
        require(is_allowed, key, disturbance, "a finite number, 0 or above")?;
        let square = self.mean_square_max;
        require(is_positive(square), "mean_square_max", square, positive)?;
        let davis = train.resistance;
        let std = prior_std(train, relative);
        let mean = Vector3::new(davis.a, davis.b, davis.c);
        let bounds = ParameterBox {
            low: self.low.map_or(Vector3::zeros(), Vector3::from),
            high: self.high.map_or(mean + std * 5.0, Vector3::from),
        };
        for i in 0..3 {
            let (low, high) = (bounds.low[i], bounds.high[i]);
            let is_allowed = low.is_finite() && high.is_finite() && low < high;
            require(is_allowed, "high", high, "finite numbers above those of `low`")?;
        }
        Ok(CheckedSettings {
            method: self.method,
            window: self.window as usize,
            interval_m,
            bounds,
            prior: DavisPrior { davis, std },
            speed_noise_mps: noise_mps,
            learns_noise: self.speed_noise_mps.is_none(),
            disturbance_mps2: match self.method {
                FitMethod::LevenbergMarquardt => {
                    disturbance * resistance_gain(train.rotating_mass_factor)
                }
                FitMethod::WolfeNewton => 0.0,
            },
            mean_square_max: square,
            seed: self.seed,
        })
    }
}

/// Settings within their ranges, in the estimator's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CheckedSettings {
    pub method: FitMethod,
    pub window: usize,
    pub interval_m: f64,
    pub bounds: ParameterBox<3>,
    pub prior: DavisPrior,
    pub speed_noise_mps: f64,
    pub learns_noise: bool,
    /// Root of the disturbance's density in m/s² √s.
    pub disturbance_mps2: f64,
    pub mean_square_max: f64,
    pub seed: u64,
}
