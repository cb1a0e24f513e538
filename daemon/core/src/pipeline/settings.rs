//! The settings of every kind of estimator, and how one is built from them.
//!
//! A new kind is one variant here and one arm in [`EstimatorSettings::build`].

use std::sync::Arc;

use dynocar_shared::PipelineKind;
use serde::Deserialize;

use super::Estimator;
use super::echo::Echo;
use super::mass::{
    JointLeastSquares, JointLeastSquaresSettings, MassKalman, MassKalmanSettings, StagedDescent,
    StagedDescentSettings,
};
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
    /// Staged gradient descent for resistance and mass.
    StagedDescent(StagedDescentSettings),
    /// Joint integral least squares for resistance and mass.
    JointLeastSquares(JointLeastSquaresSettings),
    /// Kalman filters [v, 1/m, bias] for mass.
    MassKalman(MassKalmanSettings),
}

impl EstimatorSettings {
    /// The kind with its default settings; `None` for a kind that cannot be built.
    pub fn default_of(kind: PipelineKind) -> Option<Self> {
        match kind {
            PipelineKind::Echo => Some(EstimatorSettings::Echo(NoSettings {})),
            PipelineKind::StagedDescent => {
                Some(EstimatorSettings::StagedDescent(Default::default()))
            }
            PipelineKind::JointLeastSquares => {
                Some(EstimatorSettings::JointLeastSquares(Default::default()))
            }
            PipelineKind::MassKalman => Some(EstimatorSettings::MassKalman(Default::default())),
            _ => None,
        }
    }

    /// The kind of estimator.
    pub fn kind(&self) -> PipelineKind {
        match self {
            EstimatorSettings::Echo(_) => PipelineKind::Echo,
            EstimatorSettings::StagedDescent(_) => PipelineKind::StagedDescent,
            EstimatorSettings::JointLeastSquares(_) => PipelineKind::JointLeastSquares,
            EstimatorSettings::MassKalman(_) => PipelineKind::MassKalman,
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
            EstimatorSettings::StagedDescent(settings) => {
                Ok(Box::new(StagedDescent::new(*settings, train)?))
            }
            EstimatorSettings::JointLeastSquares(settings) => {
                Ok(Box::new(JointLeastSquares::new(*settings, train)?))
            }
            EstimatorSettings::MassKalman(settings) => {
                Ok(Box::new(MassKalman::new(*settings, train)?))
            }
        }
    }
}
