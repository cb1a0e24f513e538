//! The settings of every kind of estimator, and how one is built from them.
//!
//! A new kind is one variant here and one arm in [`EstimatorSettings::build`].

use std::sync::Arc;

use dynocar_shared::PipelineKind;
use serde::Deserialize;

use super::Estimator;
use super::braking::settings::{EkfSettings, EmSettings, LawSettings, SmootherSettings};
use super::echo::Echo;
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
    /// Adhesion by sliding-window EM.
    AdhesionEm(EmSettings),
    /// Adhesion by extended Kalman filter.
    AdhesionEkf(EkfSettings),
    /// Adhesion by fixed-lag smoothing.
    AdhesionSmoother(SmootherSettings),
    /// Adhesion as the scale of a known law.
    AdhesionLaw(LawSettings),
    /// Disc friction or braking ratio by sliding-window EM.
    BrakeEm(EmSettings),
    /// Disc friction or braking ratio by extended Kalman filter.
    BrakeEkf(EkfSettings),
    /// Disc friction or braking ratio by fixed-lag smoothing.
    BrakeSmoother(SmootherSettings),
}

impl EstimatorSettings {
    /// The kind with its default settings; `None` for a kind that cannot be built.
    pub fn default_of(kind: PipelineKind) -> Option<Self> {
        match kind {
            PipelineKind::Echo => Some(EstimatorSettings::Echo(NoSettings {})),
            PipelineKind::AdhesionEm => Some(EstimatorSettings::AdhesionEm(EmSettings::default())),
            PipelineKind::AdhesionEkf => {
                Some(EstimatorSettings::AdhesionEkf(EkfSettings::default()))
            }
            PipelineKind::AdhesionSmoother => {
                Some(EstimatorSettings::AdhesionSmoother(SmootherSettings::default()))
            }
            PipelineKind::AdhesionLaw => {
                Some(EstimatorSettings::AdhesionLaw(LawSettings::default()))
            }
            PipelineKind::BrakeEm => Some(EstimatorSettings::BrakeEm(EmSettings::default())),
            PipelineKind::BrakeEkf => Some(EstimatorSettings::BrakeEkf(EkfSettings::default())),
            PipelineKind::BrakeSmoother => {
                Some(EstimatorSettings::BrakeSmoother(SmootherSettings::default()))
            }
            _ => None,
        }
    }

    /// The kind of estimator.
    pub fn kind(&self) -> PipelineKind {
        match self {
            EstimatorSettings::Echo(_) => PipelineKind::Echo,
            EstimatorSettings::AdhesionEm(_) => PipelineKind::AdhesionEm,
            EstimatorSettings::AdhesionEkf(_) => PipelineKind::AdhesionEkf,
            EstimatorSettings::AdhesionSmoother(_) => PipelineKind::AdhesionSmoother,
            EstimatorSettings::AdhesionLaw(_) => PipelineKind::AdhesionLaw,
            EstimatorSettings::BrakeEm(_) => PipelineKind::BrakeEm,
            EstimatorSettings::BrakeEkf(_) => PipelineKind::BrakeEkf,
            EstimatorSettings::BrakeSmoother(_) => PipelineKind::BrakeSmoother,
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
            EstimatorSettings::AdhesionEm(settings) => settings.build_adhesion(train),
            EstimatorSettings::AdhesionEkf(settings) => settings.build_adhesion(train),
            EstimatorSettings::AdhesionSmoother(settings) => settings.build_adhesion(train),
            EstimatorSettings::AdhesionLaw(settings) => settings.build_adhesion(train),
            EstimatorSettings::BrakeEm(settings) => settings.build_brake(train),
            EstimatorSettings::BrakeEkf(settings) => settings.build_brake(train),
            EstimatorSettings::BrakeSmoother(settings) => settings.build_brake(train),
        }
    }
}
