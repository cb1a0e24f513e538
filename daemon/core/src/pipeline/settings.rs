//! The settings of every kind of estimator, and how one is built from them.
//!
//! A new kind is one entry of the list at the end.

use std::sync::Arc;

use dynocar_shared::PipelineKind;
use serde::Deserialize;

use super::Estimator;
use super::echo::Echo;
use super::mass::{
    JointLeastSquares, JointLeastSquaresSettings, MassKalman, MassKalmanSettings, StagedDescent,
    StagedDescentSettings,
};
use super::resistance;
use super::resistance::settings::{LsSettings, MilsSettings, RlsSettings};
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

/// Lists every kind once: variant with its settings, the kind's number, and how it is built.
macro_rules! estimator_kinds {
    ($( $(#[$meta:meta])* $variant:ident($settings:ty) = $kind:ident, $build:expr; )*) => {
        /// An estimator's kind with its settings, as in `[[pipelines]]` of the daemon's
        /// configuration.
        #[derive(Clone, Debug, PartialEq, Deserialize)]
        #[serde(tag = "kind", rename_all = "snake_case")]
        pub enum EstimatorSettings { $( $(#[$meta])* $variant($settings), )* }

        impl EstimatorSettings {
            /// The kind with its default settings; `None` for a kind that cannot be built.
            pub fn default_of(kind: PipelineKind) -> Option<Self> {
                match kind {
                    $( PipelineKind::$kind => {
                        Some(EstimatorSettings::$variant(<$settings>::default()))
                    } )*
                    _ => None,
                }
            }

            /// The kind of estimator.
            pub fn kind(&self) -> PipelineKind {
                match self { $( EstimatorSettings::$variant(_) => PipelineKind::$kind, )* }
            }

            /// Builds the estimator for a train.
            ///
            /// # Errors
            ///
            /// When a setting lies outside its range.
            pub fn build(
                &self,
                train: &Arc<TrainModel>,
            ) -> Result<Box<dyn Estimator>, SettingError> {
                match self {
                    $( EstimatorSettings::$variant(settings) => {
                        fn call<S, E: Estimator + 'static>(
                            build: impl Fn(&Arc<TrainModel>, &S) -> Result<E, SettingError>,
                            train: &Arc<TrainModel>,
                            settings: &S,
                        ) -> Result<Box<dyn Estimator>, SettingError> {
                            Ok(Box::new(build(train, settings)?))
                        }
                        call($build, train, settings)
                    } )*
                }
            }
        }
    };
}

estimator_kinds! {
    /// No estimate: the latency floor.
    Echo(NoSettings) = Echo, |_, _| Ok(Echo);
    /// Regularised least squares over all rows.
    Ls(LsSettings) = LeastSquares, |t, s| resistance::ls(t, s);
    /// Recursive least squares with directional forgetting.
    Rls(RlsSettings) = Rls, |t, s| resistance::rls(t, s);
    /// Regularised recursive least squares.
    RegularisedRls(MilsSettings) = RegularisedRls, |t, s| resistance::regularised_rls(t, s);
    /// Regularised multi-innovation least squares.
    Mils(MilsSettings) = Mils, |t, s| resistance::mils(t, s);
    /// Interval-varying, regularised multi-innovation least squares.
    VMils(MilsSettings) = VMils, |t, s| resistance::v_mils(t, s);
    /// Staged gradient descent for resistance and mass.
    StagedDescent(StagedDescentSettings) = StagedDescent, |t, s| StagedDescent::new(*s, t);
    /// Joint integral least squares for resistance and mass.
    JointLeastSquares(JointLeastSquaresSettings) = JointLeastSquares,
        |t, s| JointLeastSquares::new(*s, t);
    /// Kalman filters [v, 1/m, bias] for mass.
    MassKalman(MassKalmanSettings) = MassKalman, |t, s| MassKalman::new(*s, t);
}
