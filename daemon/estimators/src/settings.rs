//! The settings of every kind of estimator, and how one is built from them.
//!
//! A new kind is one entry of the list at the end.

use std::sync::Arc;

use dynocar_core::pipeline::braking::intake::BrakingCoefficient;
use dynocar_core::pipeline::braking::settings::{
    BrakeFactor, EkfSettings, LawSettings, SmootherSettings,
};
use dynocar_core::pipeline::monitor::{MonitorSettings, ResidualMonitor};
use dynocar_core::pipeline::output::candidates;
use dynocar_core::pipeline::train_kalman::{TrainKalman, TrainKalmanSettings};
use dynocar_core::pipeline::{Echo, Estimator, SettingError};
use dynocar_model::train::TrainModel;
use dynocar_shared::{PipelineKind, Quantity};
use serde::Deserialize;

use crate::resistance;
use crate::resistance::settings::{KalmanSettings, LsSettings, MilsSettings, RlsSettings};
use crate::wang::{
    JointLeastSquares, JointLeastSquaresSettings, MassKalman, MassKalmanSettings, StagedDescent,
    StagedDescentSettings,
};
use crate::xia::newton::{TrajectoryNewton, TrajectoryNewtonSettings};
use crate::xia::trajectory::kalman::TrajectoryKalmanSettings;
use crate::xie::EmSettings;

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
            /// Returns the kind with its default settings; `None` for a kind that cannot be built.
            #[allow(unreachable_patterns, reason = "the vocabulary may name kinds to come")]
            pub fn default_of(kind: PipelineKind) -> Option<Self> {
                match kind {
                    $( PipelineKind::$kind => {
                        Some(EstimatorSettings::$variant(<$settings>::default()))
                    } )*
                    _ => None,
                }
            }

            /// Returns the kind of estimator.
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
                        call($build, settings, train)
                    } )*
                }
            }
        }
    };
}

type Built = Result<Box<dyn Estimator>, SettingError>;

/// Calls a kind's way of building; names the closure's types.
fn call<S>(
    build: impl Fn(&S, &Arc<TrainModel>) -> Built,
    settings: &S,
    train: &Arc<TrainModel>,
) -> Built {
    build(settings, train)
}

fn boxed<E: Estimator + 'static>(built: Result<E, SettingError>) -> Built {
    Ok(Box::new(built?))
}

estimator_kinds! {
    /// No estimate: the latency floor.
    Echo(NoSettings) = Echo, |_, _| boxed(Ok(Echo));
    /// Regularised least squares over all rows.
    Ls(LsSettings) = Ls, |s, t| boxed(resistance::ls(t, s));
    /// Recursive least squares with directional forgetting.
    Rls(RlsSettings) = Rls, |s, t| boxed(resistance::rls(t, s));
    /// Regularised recursive least squares.
    RegularisedRls(MilsSettings) = RegularisedRls,
        |s, t| boxed(resistance::regularised(PipelineKind::RegularisedRls, t, s));
    /// Regularised multi-innovation least squares.
    Mils(MilsSettings) = Mils,
        |s, t| boxed(resistance::regularised(PipelineKind::Mils, t, s));
    /// Interval-varying, regularised multi-innovation least squares.
    VMils(MilsSettings) = VMils,
        |s, t| boxed(resistance::regularised(PipelineKind::VMils, t, s));
    /// Robust Kalman filter of resistance jointly with a disturbance.
    ResistanceKalman(KalmanSettings) = ResistanceKalman, |s, t| boxed(resistance::kalman(t, s));
    /// Trajectory fit over a sliding window.
    TrajectoryNewton(TrajectoryNewtonSettings) = TrajectoryNewton,
        |s, t| boxed(TrajectoryNewton::new(s, t));
    /// Kalman filter [v, a, b, c] with jump hypotheses.
    TrajectoryKalman(TrajectoryKalmanSettings) = TrajectoryKalman, |s, t| boxed(s.build(t));
    /// Staged gradient descent for resistance and mass.
    StagedDescent(StagedDescentSettings) = StagedDescent, |s, t| boxed(StagedDescent::new(*s, t));
    /// Joint integral least squares for resistance and mass.
    JointLeastSquares(JointLeastSquaresSettings) = JointLeastSquares,
        |s, t| boxed(JointLeastSquares::new(*s, t));
    /// Kalman filters [v, 1/m, bias] for mass.
    MassKalman(MassKalmanSettings) = MassKalman, |s, t| boxed(MassKalman::new(*s, t));
    /// Kalman filters of resistance and mass together.
    TrainKalman(TrainKalmanSettings) = TrainKalman, |s, t| boxed(TrainKalman::new(*s, t));
    /// Watches the residual and names the effects that the model may lack.
    ResidualMonitor(MonitorSettings) = ResidualMonitor,
        |s, t| boxed(ResidualMonitor::new(*s, t));
    /// Adhesion by sliding-window EM.
    AdhesionEm(EmSettings) = AdhesionEm,
        |s, t| s.build(PipelineKind::AdhesionEm, BrakingCoefficient::Adhesion, t);
    /// Adhesion by extended Kalman filter.
    AdhesionEkf(EkfSettings) = AdhesionEkf,
        |s, t| s.build(PipelineKind::AdhesionEkf, BrakingCoefficient::Adhesion, t);
    /// Adhesion by fixed-lag smoothing.
    AdhesionSmoother(SmootherSettings) = AdhesionSmoother,
        |s, t| s.build(PipelineKind::AdhesionSmoother, BrakingCoefficient::Adhesion, t);
    /// Adhesion as the scale of a known law.
    AdhesionLaw(LawSettings) = AdhesionLaw, |s, t| s.build_adhesion(t);
    /// Disc friction or braking ratio by sliding-window EM.
    BrakeEm(EmSettings) = BrakeEm,
        |s, t| s.build(PipelineKind::BrakeEm, s.reports.quantity(), t);
    /// Disc friction or braking ratio by extended Kalman filter.
    BrakeEkf(EkfSettings) = BrakeEkf,
        |s, t| s.build(PipelineKind::BrakeEkf, s.reports.quantity(), t);
    /// Disc friction or braking ratio by fixed-lag smoothing.
    BrakeSmoother(SmootherSettings) = BrakeSmoother,
        |s, t| s.build(PipelineKind::BrakeSmoother, s.reports.quantity(), t);
}

impl EstimatorSettings {
    /// Returns whether the estimator, with these settings, answers a quantity of a controller.
    pub fn answers(&self, quantity: Quantity) -> bool {
        let reports = match self {
            EstimatorSettings::BrakeSmoother(settings) => Some(settings.reports),
            EstimatorSettings::BrakeEkf(settings) => Some(settings.reports),
            EstimatorSettings::BrakeEm(settings) => Some(settings.reports),
            _ => None,
        };
        candidates(quantity).contains(&self.kind())
            && match quantity {
                Quantity::BrakeFriction => reports == Some(BrakeFactor::Friction),
                Quantity::BrakingRatio => reports == Some(BrakeFactor::Ratio),
                _ => true,
            }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers come from the estimator alone, so that a kind which never writes a quantity's
    /// parameters cannot answer it.
    #[test]
    fn every_kind_but_monitor_and_echo_answers_something() {
        for &kind in PipelineKind::ALL {
            let settings = EstimatorSettings::default_of(kind).expect("every kind can be built");
            let answers = Quantity::ALL.iter().filter(|&&it| settings.answers(it)).count();
            let is_silent = matches!(kind, PipelineKind::ResidualMonitor | PipelineKind::Echo);
            assert_eq!(answers == 0, is_silent, "{kind}");
        }
    }

    #[test]
    fn a_brake_pipeline_answers_for_the_factor_that_it_reports() {
        let set = |reports| {
            let table = format!("kind = \"brake_smoother\"\nreports = \"{reports}\"");
            toml::from_str::<EstimatorSettings>(&table).unwrap()
        };
        let answered = |settings: EstimatorSettings| {
            Quantity::ALL.iter().copied().filter(|&it| settings.answers(it)).collect::<Vec<_>>()
        };
        assert_eq!(answered(set("friction")), [Quantity::BrakeFriction]);
        assert_eq!(answered(set("ratio")), [Quantity::BrakingRatio]);
    }
}
