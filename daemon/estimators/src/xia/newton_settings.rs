//! Settings of `trajectory_newton`.

use dynocar_core::filter::levenberg_marquardt::ParameterBox;
use dynocar_core::pipeline::settings::{SettingError, require};
use dynocar_core::settings;
use dynocar_model::force::balance::mps2_per_n_per_kn;
use dynocar_model::train::TrainModel;
use nalgebra::Vector3;
use serde::Deserialize;

use crate::xia::trajectory::fit::DavisPrior;
use crate::xia::trajectory::quality::prior_std;

/// How a window is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FitMethod {
    /// Box-constrained least squares with free initial speed and a prior; steps in time.
    LevenbergMarquardt,
    /// Algorithm 1 of the paper: Newton, Wolfe steps, restarts; steps by eq. 7.
    WolfeNewton,
}

settings! {
    /// Settings of `trajectory_newton`.
    #[derive(Copy)]
    TrajectoryNewtonSettings {
        /// How a window is fitted.
        method: FitMethod = FitMethod::LevenbergMarquardt;
        /// Steps of a window, the data capacity I of the paper.
        window: u32 = 20 => (5 to 5000 "steps");
        /// Distance in m between points.
        interval_m: f64 = 100.0 => (1 to 10000 "m");
        /// Standard deviations of the declared coefficients, as a share of each; they bind what a
        /// window does not determine.
        prior_relative_std: f64 = 0.5 => (above 0);
        /// Standard deviation of the measured speed in m/s; learned from the residuals when absent.
        speed_noise_mps: Option<f64> = None => (above 0);
        /// Root of the density of disturbing forces in N/kN √s, for `levenberg_marquardt`; 0 fits
        /// the whole trajectory as the paper does.
        disturbance_n_per_kn_sqrt_s: f64 = 0.2 => (0 or more);
        /// Lowest a, b, c; 0 when absent. Table 2 of the paper has 0.4, 0, 0.
        low: Option<[f64; 3]> = None;
        /// Highest a, b, c; five prior standard deviations above the declared when absent. Table 2
        /// of the paper has 3, 0.2, 0.01.
        high: Option<[f64; 3]> = None;
        /// ε1 of eq. 25 in (m/s)², for `wolfe_newton`.
        mean_square_max: f64 = 0.05 => (above 0);
        /// Seed of the restarts, for `wolfe_newton`.
        seed: u64 = 1;
    }
}

impl TrajectoryNewtonSettings {
    /// Bounds and prior for a train.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub(crate) fn checked(
        &self,
        train: &TrainModel,
    ) -> Result<(ParameterBox<3>, DavisPrior), SettingError> {
        self.check_ranges()?;
        let davis = train.resistance;
        let std = prior_std(train, self.prior_relative_std);
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
        Ok((bounds, DavisPrior { davis, std }))
    }

    /// Root of the density of the disturbance in m/s² √s.
    pub(crate) fn disturbance_mps2(&self, train: &TrainModel) -> f64 {
        match self.method {
            FitMethod::LevenbergMarquardt => {
                self.disturbance_n_per_kn_sqrt_s * mps2_per_n_per_kn(train.rotating_mass_factor)
            }
            FitMethod::WolfeNewton => 0.0,
        }
    }
}
