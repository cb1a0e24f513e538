//! A regression under one assumption on the unexplained acceleration.

use dynocar_core::filter::DriftingLevel;
use dynocar_core::filter::drifting_level::DriftStep;

use super::bias_model::{BiasModel, MapError};
use super::integrals::{Row, UNKNOWNS};

/// A step of time between two samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Its length in s.
    pub step_s: f64,
    /// Speed in m/s at its start.
    pub speed_mps: f64,
    /// Change of the force's acceleration over it in m/s².
    pub push_change_mps2: f64,
    /// What the map's error does over it.
    pub map: MapError,
    /// Variance in (m/s)² of what comes to the level under any assumption.
    pub noise_variance: f64,
}

/// What a measured speed looks like to a regression.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expectation {
    /// Measured minus predicted speed over its standard deviation.
    pub normalised: f64,
    /// Measured minus predicted speed in m/s.
    pub error_mps: f64,
    /// Measured minus filtered speed in m/s.
    pub residual_mps: f64,
    /// Variance of the filtered speed in (m/s)².
    pub filtered_variance: f64,
}

/// The regression under its assumption.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    model: BiasModel,
    regression: DriftingLevel<UNKNOWNS>,
}

impl Hypothesis {
    /// A regression that starts from prior knowledge.
    pub fn new(model: BiasModel, mean: &Row, std: &Row) -> Self {
        let mut regression = DriftingLevel::new(mean, std);
        regression.restart_bias(model.std_mps2);
        Hypothesis { model, regression }
    }

    /// The regression.
    pub fn regression(&self) -> &DriftingLevel<UNKNOWNS> {
        &self.regression
    }

    /// Bias in m/s² at a speed for a stated bias of 1 m/s².
    pub fn shape(&self, speed_mps: f64) -> f64 {
        self.model.shape(speed_mps)
    }

    /// Forgets the level after a gap.
    pub fn free_level(&mut self) {
        self.regression.free_level();
    }

    /// Opens the mass by a standard deviation relative to the reference.
    pub fn reopen(&mut self, relative_std: f64) {
        let variance = relative_std * relative_std;
        self.regression.widen_first_parameter(variance, self.model.std_mps2);
    }

    /// Begins on a map whose gradient errs, with a bias of which nothing is known.
    pub fn begin_on_map(&mut self, map: &MapError, speed_mps: f64) {
        self.regression.restart_bias(self.model.std_given_others_mps2(map.std_mps2, speed_mps));
    }

    /// Moves on by a step of time.
    pub fn propagate(&mut self, step: &Step) {
        let keep = self.model.keep(step.step_s);
        let (keep, noise_variance) = self.model.drift(keep, &step.map, step.speed_mps);
        let jump_variance = self.model.jump_variance(step.push_change_mps2, step.step_s);
        self.regression.propagate(&DriftStep {
            gain: step.step_s * self.model.shape(step.speed_mps),
            keep,
            noise_variance,
            level_noise_variance: step.noise_variance + jump_variance,
        });
    }

    /// What an equation of a measured speed with a noise variance would bring.
    pub fn expect(&self, row: &Row, value: f64, noise_variance: f64) -> Expectation {
        let innovation = self.regression.clone().absorb(row, value, 1.0 / noise_variance);
        let normalised = innovation.normalised.unwrap_or(0.0);
        let variance_ratio = innovation.log_variance_ratio.exp();
        let error_mps = normalised * (noise_variance * variance_ratio).sqrt();
        Expectation {
            normalised,
            error_mps,
            residual_mps: error_mps / variance_ratio,
            filtered_variance: noise_variance * (1.0 - 1.0 / variance_ratio),
        }
    }

    /// Absorbs an equation; gives the logarithm of its likelihood, up to what is common to all
    /// assumptions.
    pub fn absorb(&mut self, row: &Row, value: f64, weight: f64) -> f64 {
        let innovation = self.regression.absorb(row, value, weight);
        let evidence =
            |normalised: f64| -0.5 * (normalised * normalised + innovation.log_variance_ratio);
        innovation.normalised.map_or(0.0, evidence)
    }
}
