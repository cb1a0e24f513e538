//! Davis a, b, c by least squares (Liu 2018), from coasting or from measured forces.
//!
//! # Layout, in the order in which a sample passes
//!
//! - [`dynocar_core::pipeline::momentum`]: samples to blocks of momentum; `regression`: blocks, and coasting
//!   segments, as observations
//! - `noise_bank`: observations to independent rows, and how noisy they are
//! - `crate::liu`: the paper's recursions and data
//! - `report`: bounds, excitation, status
//! - `least_squares`: the pipeline around these parts
//! - `kalman`: the robust filter over every sample, with a least-squares pipeline in parallel

mod kalman;
mod least_squares;
pub(crate) mod noise_bank;
mod observation_source;
pub(crate) mod regression;
mod report;
pub mod settings;
#[cfg(test)]
pub(crate) mod test_runs;
#[cfg(test)]
mod tests;

pub use kalman::ResistanceKalman;
pub use least_squares::ResistanceLeastSquares;

use dynocar_core::pipeline::SettingError;
use dynocar_model::train::TrainModel;
use dynocar_shared::PipelineKind;

use self::settings::{KalmanSettings, LsSettings, MilsSettings, RlsSettings};
use crate::liu::Solver;

/// Regularised least squares over all rows (Liu 2018, eq. 7).
///
/// # Errors
///
/// When a setting lies outside its range.
pub fn ls(
    train: &TrainModel,
    settings: &LsSettings,
) -> Result<ResistanceLeastSquares, SettingError> {
    settings.check_ranges()?;
    let kind = PipelineKind::Ls;
    let (data, lambda) = (settings.data, settings.lambda);
    Ok(ResistanceLeastSquares::new(kind, train, data, Solver::Batch, lambda, 1.0))
}

/// Recursive least squares (eq. 9-11) with directional forgetting.
///
/// # Errors
///
/// When a setting lies outside its range.
pub fn rls(
    train: &TrainModel,
    settings: &RlsSettings,
) -> Result<ResistanceLeastSquares, SettingError> {
    settings.check_ranges()?;
    let solver = Solver::rls(settings);
    // The bank needs some regularisation of its own while rows are few.
    let lambda = 2.0 / settings.start_variance;
    let (data, forgetting) = (settings.data, settings.forgetting);
    Ok(ResistanceLeastSquares::new(PipelineKind::Rls, train, data, solver, lambda, forgetting))
}

/// Regularised least squares of a kind: recursive (eq. 12-16), multi-innovation, or interval-varying
/// multi-innovation.
///
/// # Errors
///
/// When a setting lies outside its range.
pub fn regularised(
    kind: PipelineKind,
    train: &TrainModel,
    settings: &MilsSettings,
) -> Result<ResistanceLeastSquares, SettingError> {
    settings.check_ranges()?;
    let innovations = settings.innovation_length as usize;
    let solver = match kind {
        PipelineKind::RegularisedRls => Solver::mils(settings, 1, None),
        PipelineKind::VMils => Solver::mils(settings, innovations, Some(settings.bad_beyond)),
        _ => Solver::mils(settings, innovations, None),
    };
    Ok(ResistanceLeastSquares::new(kind, train, settings.data, solver, settings.lambda, 1.0))
}

/// Returns a robust Kalman filter with a disturbance state.
///
/// # Errors
///
/// When a setting lies outside its range.
pub fn kalman(
    train: &TrainModel,
    settings: &KalmanSettings,
) -> Result<ResistanceKalman, SettingError> {
    settings.check_ranges()?;
    let least_squares = ls(train, &LsSettings { data: settings.data, ..LsSettings::default() })?;
    Ok(ResistanceKalman::new(train, *settings, least_squares))
}
