//! A regression under one assumption on the unexplained acceleration.

use super::bias_model::BiasModel;
use super::integrals::{Row, UNKNOWNS};
use crate::filter::DriftingLevel;
use crate::filter::drifting_level::DriftStep;

/// Innovations that the speed noise of the settings counts for.
const NOISE_PRIOR_COUNT: f64 = 4.0;

/// What a measured speed looks like to a regression.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expectation {
    /// Measured minus predicted speed over the estimated standard deviation.
    pub normalised: f64,
    /// Measured minus predicted speed in m/s.
    pub error_mps: f64,
}

/// The regression with the evidence for its assumption.
///
/// The speed noise is assumed at first; its true variance is estimated from the innovations and
/// scales the covariance.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    model: BiasModel,
    regression: DriftingLevel<UNKNOWNS>,
    squares: f64,
    count: f64,
    log_ratios: f64,
}

impl Hypothesis {
    /// A regression that starts from prior knowledge.
    pub fn new(model: BiasModel, mean: &Row, std: &Row) -> Self {
        let mut regression = DriftingLevel::new(mean, std);
        regression.restart_bias(model.std_mps2);
        Hypothesis { model, regression, squares: 0.0, count: 0.0, log_ratios: 0.0 }
    }

    /// The regression.
    pub fn regression(&self) -> &DriftingLevel<UNKNOWNS> {
        &self.regression
    }

    /// Bias in m/s² at a speed for a stated bias of 1 m/s².
    pub fn shape(&self, speed_mps: f64) -> f64 {
        self.model.shape(speed_mps)
    }

    /// Estimated over assumed variance of the measured speed.
    pub fn noise_scale(&self) -> f64 {
        (NOISE_PRIOR_COUNT + self.squares) / (NOISE_PRIOR_COUNT + self.count)
    }

    /// Logarithm of the likelihood with the noise variance at its estimate.
    pub fn evidence(&self) -> f64 {
        let count = NOISE_PRIOR_COUNT + self.count;
        -0.5 * (self.log_ratios + count * self.noise_scale().ln())
    }

    /// Forgets the level after a gap.
    pub fn free_level(&mut self) {
        self.regression.free_level();
    }

    /// Opens the mass by a standard deviation relative to the reference.
    pub fn reopen(&mut self, relative_std: f64) {
        let variance = relative_std * relative_std / self.noise_scale();
        self.regression.widen_first_parameter(variance, self.model.std_mps2);
    }

    /// Moves on by a step of time, with a variance in (m/s)² of what comes to the
    /// level besides.
    pub fn propagate(&mut self, step_s: f64, speed_mps: f64, level_noise_variance: f64) {
        let keep = self.model.keep(step_s);
        self.regression.propagate(&DriftStep {
            gain: step_s * self.model.shape(speed_mps),
            keep,
            noise_variance: self.model.noise_variance(keep),
            level_noise_variance,
        });
    }

    /// What an equation of a measured speed with a noise deviation would bring.
    pub fn expect(&self, row: &Row, value: f64, noise_mps: f64) -> Expectation {
        let innovation = self.regression.clone().absorb(row, value, noise_mps.powi(-2));
        let normalised = innovation.normalised.unwrap_or(0.0);
        let root_ratio = (0.5 * innovation.log_variance_ratio).exp();
        Expectation {
            normalised: normalised / self.noise_scale().sqrt(),
            error_mps: normalised * noise_mps * root_ratio,
        }
    }

    /// Absorbs an equation.
    pub fn absorb(&mut self, row: &Row, value: f64, weight: f64) {
        let innovation = self.regression.absorb(row, value, weight);
        if let Some(normalised) = innovation.normalised {
            self.squares += normalised * normalised;
            self.count += 1.0;
            self.log_ratios += innovation.log_variance_ratio;
        }
    }
}
