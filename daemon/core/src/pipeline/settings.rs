//! The settings of every kind of estimator, and how one is built from them.
//!
//! A new kind is one variant here and one arm in [`EstimatorSettings::build`].

use std::sync::Arc;

use dynocar_shared::PipelineKind;
use serde::Deserialize;

use super::Estimator;
use super::echo::Echo;
use super::resistance;
use super::resistance::settings::{KalmanSettings, LsSettings, MilsSettings, RlsSettings};
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
    /// Regularised least squares over all rows.
    Ls(LsSettings),
    /// Recursive least squares with directional forgetting.
    Rls(RlsSettings),
    /// Regularised recursive least squares.
    RegularisedRls(MilsSettings),
    /// Regularised multi-innovation least squares.
    Mils(MilsSettings),
    /// Interval-varying, regularised multi-innovation least squares.
    VMils(MilsSettings),
    /// Robust resistance filter with a disturbance state.
    ResistanceKalman(KalmanSettings),
}

impl EstimatorSettings {
    /// The kind with its default settings; `None` for a kind that cannot be built.
    pub fn default_of(kind: PipelineKind) -> Option<Self> {
        match kind {
            PipelineKind::Echo => Some(EstimatorSettings::Echo(NoSettings {})),
            PipelineKind::LeastSquares => Some(EstimatorSettings::Ls(LsSettings::default())),
            PipelineKind::Rls => Some(EstimatorSettings::Rls(RlsSettings::default())),
            PipelineKind::RegularisedRls => {
                Some(EstimatorSettings::RegularisedRls(MilsSettings::default()))
            }
            PipelineKind::Mils => Some(EstimatorSettings::Mils(MilsSettings::default())),
            PipelineKind::VMils => Some(EstimatorSettings::VMils(MilsSettings::default())),
            PipelineKind::ResistanceKalman => {
                Some(EstimatorSettings::ResistanceKalman(KalmanSettings::default()))
            }
            _ => None,
        }
    }

    /// The kind of estimator.
    pub fn kind(&self) -> PipelineKind {
        match self {
            EstimatorSettings::Echo(_) => PipelineKind::Echo,
            EstimatorSettings::Ls(_) => PipelineKind::LeastSquares,
            EstimatorSettings::Rls(_) => PipelineKind::Rls,
            EstimatorSettings::RegularisedRls(_) => PipelineKind::RegularisedRls,
            EstimatorSettings::Mils(_) => PipelineKind::Mils,
            EstimatorSettings::VMils(_) => PipelineKind::VMils,
            EstimatorSettings::ResistanceKalman(_) => PipelineKind::ResistanceKalman,
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
            EstimatorSettings::Ls(settings) => Ok(Box::new(resistance::ls(train, settings)?)),
            EstimatorSettings::Rls(settings) => Ok(Box::new(resistance::rls(train, settings)?)),
            EstimatorSettings::RegularisedRls(settings) => {
                Ok(Box::new(resistance::regularised_rls(train, settings)?))
            }
            EstimatorSettings::Mils(settings) => Ok(Box::new(resistance::mils(train, settings)?)),
            EstimatorSettings::VMils(settings) => {
                Ok(Box::new(resistance::v_mils(train, settings)?))
            }
            EstimatorSettings::ResistanceKalman(settings) => {
                Ok(Box::new(resistance::kalman(train, settings)?))
            }
        }
    }
}
