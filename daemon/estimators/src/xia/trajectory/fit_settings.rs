//! What a trajectory fit is asked for, and what it answers.

use dynocar_core::filter::levenberg_marquardt::{ParameterBox, Stop};
use dynocar_core::filter::triangular::TriangularSystem;
use dynocar_model::train::Davis;
use nalgebra::{Matrix3, Vector3};

use super::step::StepRule;

/// What is known of the coefficients before the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DavisPrior {
    /// Expected coefficients.
    pub davis: Davis,
    /// Their standard deviations, independent.
    pub std: Vector3<f64>,
}

impl DavisPrior {
    pub(super) fn rows(&self) -> TriangularSystem<3> {
        let mean = Vector3::new(self.davis.a, self.davis.b, self.davis.c);
        TriangularSystem {
            factor: Matrix3::from_diagonal(&self.std.map(|std| 1.0 / std)),
            residual: -mean.component_div(&self.std),
        }
    }
}

/// How to fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitSettings {
    /// What the steps' sizes count.
    pub rule: StepRule,
    /// Lowest and highest a, b and c.
    pub bounds: ParameterBox<3>,
    /// Prior knowledge of the coefficients.
    pub prior: Option<DavisPrior>,
    /// Standard deviation of the measured speed in m/s; `None` estimates it.
    pub speed_noise_mps: Option<f64>,
    /// Density of a disturbing acceleration, white over the steps (wind, gradient errors, force
    /// errors), over the variance of the measured speed, q / R in 1/s; 0 for exact forces: output
    /// error, as in Xia 2023.
    pub disturbance_ratio: f64,
    /// Residuals beyond so many standard deviations count linearly; infinity for never.
    pub outlier_threshold: f64,
    /// Decrease of the cost, half the sum of squared standard deviations, that is worth another
    /// iteration: ε leaves the coefficients within √(2 ε) standard deviations.
    pub decrease_tolerance: f64,
}

impl FitSettings {
    /// Physical bounds, no prior, exact forces, noise estimated, outliers beyond 4 standard
    /// deviations (the loss of efficiency without outliers is below 0.1 %).
    pub fn new(rule: StepRule) -> Self {
        FitSettings {
            rule,
            bounds: ParameterBox { low: Vector3::zeros(), high: Vector3::new(50.0, 1.0, 0.1) },
            prior: None,
            speed_noise_mps: None,
            disturbance_ratio: 0.0,
            outlier_threshold: 4.0,
            decrease_tolerance: 1e-8,
        }
    }

    pub(super) fn check(&self) -> Result<(), FitError> {
        let require = |is_allowed: bool, key, value, allowed| match is_allowed {
            true => Ok(()),
            false => Err(FitError::BadSetting { key, value, allowed }),
        };
        let noise_mps = self.speed_noise_mps.unwrap_or(1.0);
        let is_allowed = noise_mps > 0.0 && noise_mps.is_finite();
        require(is_allowed, "speed_noise_mps", noise_mps, "a finite number above 0")?;
        let ratio = self.disturbance_ratio;
        let is_allowed = ratio >= 0.0 && ratio.is_finite();
        require(is_allowed, "disturbance_ratio", ratio, "a finite number, 0 or above")?;
        let threshold = self.outlier_threshold;
        require(threshold > 0.0, "outlier_threshold", threshold, "above 0")
    }
}

/// Why trajectories cannot be fitted.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// A motion segment has not one speed more than steps.
    #[error(
        "motion segment {segment}: expected one speed more than its {steps} steps, got {speeds}"
    )]
    LengthMismatch {
        /// Number of the motion segment, from 0.
        segment: usize,
        /// Its steps.
        steps: usize,
        /// Its speeds.
        speeds: usize,
    },
    /// A speed, step or setting is not a usable number.
    #[error("motion segment {segment}: expected finite numbers and steps above 0")]
    NotFinite {
        /// Number of the motion segment, from 0.
        segment: usize,
    },
    /// A setting is out of its range.
    #[error("{key} = {value}: expected {allowed}")]
    BadSetting {
        /// The setting's name.
        key: &'static str,
        /// Its value.
        value: f64,
        /// The allowed range, in words.
        allowed: &'static str,
    },
    /// Fewer samples than parameters.
    #[error("expected at least {need} speeds, got {got}")]
    TooFewSamples {
        /// Needed.
        need: usize,
        /// Given.
        got: usize,
    },
    /// The data leave a direction of (a, b, c) open.
    #[error("the trajectories do not determine the coefficients")]
    NotDetermined,
}

/// Davis coefficients with all that is known about them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryFit {
    /// The coefficients.
    pub davis: Davis,
    /// Their covariance, widened where the residuals are correlated over tens of seconds.
    pub covariance: Matrix3<f64>,
    /// Factor by which it was widened, see [`super::long_run`].
    pub inflation: f64,
    /// Standard deviation of the measured speed in m/s, as given or estimated.
    pub speed_noise_mps: f64,
    /// Standard deviation in m/s that the residuals show, outliers clipped.
    pub residual_std_mps: f64,
    /// Root of the mean squared residual in m/s; with exact forces that of the trajectory.
    pub rmse_mps: f64,
    /// Fitted speed in m/s at the end of the last segment.
    pub end_speed_mps: f64,
    /// Variance of the disturbance in it, over that of the measured speed.
    pub end_variance: f64,
    /// Speeds behind the fit.
    pub samples: usize,
    /// Residuals beyond the outlier threshold.
    pub outliers: usize,
    /// Steps in which the fitted train would have stopped.
    pub stalls: usize,
    /// Linearisations in all.
    pub iterations: u32,
    /// How the last search ended.
    pub stop: Stop,
    /// Coefficients at a bound.
    pub at_bound: [bool; 3],
}

impl TrajectoryFit {
    /// Standard deviation of w0 in N/kN at a speed in m/s.
    pub fn w0_std_n_per_kn(&self, speed_mps: f64) -> f64 {
        let powers = Vector3::new(1.0, speed_mps, speed_mps * speed_mps);
        (powers.transpose() * self.covariance * powers)[0].max(0.0).sqrt()
    }
}

/// Typical sizes of a, b and c.
pub(super) const SCALES: [f64; 3] = [1.0, 0.02, 0.001];
