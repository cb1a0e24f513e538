//! The settings of every kind of estimator, and how one is built from them.
//!
//! A new kind is one variant here and one arm in [`EstimatorSettings::build`].

use std::sync::Arc;

use dynocar_shared::PipelineKind;
use serde::Deserialize;

use super::Estimator;
use super::echo::Echo;
use super::trajectory::kalman::TrajectoryKalmanSettings;
use super::trajectory::newton_settings::TrajectoryNewtonSettings;
use crate::train::TrainModel;

/// A setting outside its allowed range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key} = {value}: expected {allowed}")]
pub struct SettingError {
    /// The setting's name.
    pub key: &'static str,
    /// The value it was given.
    pub value: f64,
    /// The allowed range, in words.
    pub allowed: &'static str,
}

/// Refuses a setting unless `is_allowed`.
///
/// # Errors
///
/// Names key, value and range.
pub fn require(
    is_allowed: bool,
    key: &'static str,
    value: f64,
    allowed: &'static str,
) -> Result<(), SettingError> {
    if is_allowed { Ok(()) } else { Err(SettingError { key, value, allowed }) }
}

/// The settings of a kind without settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoSettings {}

/// An estimator's kind with its settings, as in `[[pipelines]]` of the daemon's configuration.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum EstimatorSettings {
    /// No estimate: the latency floor.
    Echo(NoSettings),
    /// Trajectory fit over a sliding window.
    TrajectoryNewton(TrajectoryNewtonSettings),
    /// Kalman filter [v, a, b, c] with jump hypotheses.
    TrajectoryKalman(TrajectoryKalmanSettings),
}

impl EstimatorSettings {
    /// The kind with its default settings; `None` for a kind that cannot be built.
    pub fn default_of(kind: PipelineKind) -> Option<Self> {
        match kind {
            PipelineKind::Echo => Some(EstimatorSettings::Echo(NoSettings {})),
            PipelineKind::TrajectoryNewton => {
                Some(EstimatorSettings::TrajectoryNewton(TrajectoryNewtonSettings::default()))
            }
            PipelineKind::TrajectoryKalman => {
                Some(EstimatorSettings::TrajectoryKalman(TrajectoryKalmanSettings::default()))
            }
            _ => None,
        }
    }

    /// The kind of estimator.
    pub fn kind(&self) -> PipelineKind {
        match self {
            EstimatorSettings::Echo(_) => PipelineKind::Echo,
            EstimatorSettings::TrajectoryNewton(_) => PipelineKind::TrajectoryNewton,
            EstimatorSettings::TrajectoryKalman(_) => PipelineKind::TrajectoryKalman,
        }
    }

    /// Builds the estimator for a train.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn build(&self, train: &Arc<TrainModel>) -> Result<Box<dyn Estimator>, SettingError> {
        match self {
            EstimatorSettings::Echo(_) => Ok(Box::new(Echo)),
            EstimatorSettings::TrajectoryNewton(settings) => Ok(Box::new(settings.build(train)?)),
            EstimatorSettings::TrajectoryKalman(settings) => Ok(Box::new(settings.build(train)?)),
        }
    }
}
