//! The pipelines of a configuration.

use std::sync::Arc;

use dynocar_core::pipeline::{Pipeline, SettingError};

use crate::config::{PipelineConfig, TrainConfig};

/// A setting of a pipeline is out of range.
#[derive(Debug, thiserror::Error)]
#[error("pipelines.{pipeline}.settings.{source}")]
pub struct SettingRefused {
    /// The pipeline's name.
    pub pipeline: String,
    /// Key, value and range.
    pub source: SettingError,
}

/// Returns a pipeline of the configuration for one of its trains, before its first sample; `index` is its
/// number in the configuration.
///
/// # Errors
///
/// When a setting is out of range.
pub fn build_pipeline(
    settings: &PipelineConfig,
    index: u32,
    train: &TrainConfig,
) -> Result<Pipeline, SettingRefused> {
    let estimator = settings
        .estimator
        .build(&train.model)
        .map_err(|source| SettingRefused { pipeline: settings.name.clone(), source })?;
    let (model, track) = (Arc::clone(&train.model), train.track.clone());
    let mut pipeline = Pipeline::new(train.id, index, model, track, estimator);
    let snapshot = pipeline.snapshot_mut();
    snapshot.quantities = train.answers.bits_of(index as usize);
    snapshot.train_quantities = train.answers.all_bits();
    snapshot.model_hash = train.model_hash.0;
    Ok(pipeline)
}
