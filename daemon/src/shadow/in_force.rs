//! Which model a train has when the daemon starts.

use std::sync::Arc;

use tracing::{info, warn};

use super::rule::Rule;
use crate::config::{DaemonConfig, TrainConfig};
use crate::models::{ModelHash, ModelsError, NewModel, Origin, Store, TrainModels};

/// Puts what the configuration declares of each train into the store, and gives each train the model
/// that the store's decisions put in force. Where the store cannot be read, what is declared stays
/// in force, and the log says why.
pub fn settle(config: &mut DaemonConfig) {
    let Some(models) = &config.models else { return };
    let store = Store::at(&models.directory);
    for train in &mut config.trains {
        if let Err(error) = settle_train(&store.train(train.id), train, &models.rule) {
            warn!(train = train.id.0, "the declared model stays in force: {error}");
        }
    }
}

fn settle_train(
    models: &TrainModels,
    train: &mut TrainConfig,
    rule: &Rule,
) -> Result<(), NotInForce> {
    put_declared(models, train)?;
    let Some(hash) = models.in_force()? else { return Ok(()) };
    permitted(models, rule, hash)?;
    *train = with_model(models, train, hash)?;
    let declared = train.text.hash();
    let mut origin = models.stored(hash)?.origin;
    let added = origin.adds();
    while let Some(parent) = origin.parent.filter(|&parent| parent != declared) {
        origin = models.stored(parent)?.origin;
    }
    if origin.parent.is_none() && hash != declared {
        let id = train.id.0;
        warn!(train = id, "model {hash} grew from other files than those that are declared now");
    }
    info!(train = train.id.0, model = %hash, "in force, as decided: {added}");
    Ok(())
}

/// Why a model that was decided on does not come in force.
#[derive(Debug, thiserror::Error)]
pub enum NotInForce {
    /// The store does not give it.
    #[error(transparent)]
    Models(#[from] ModelsError),
    /// It lies outside the configuration's bounds.
    #[error("model {hash} is out of bounds: {outside}")]
    OutOfBounds {
        /// The model.
        hash: ModelHash,
        /// Key, value and bounds.
        outside: String,
    },
}

/// Whether a model may come in force, whoever decided so.
///
/// # Errors
///
/// When the store does not give it, or it lies outside the bounds.
pub fn permitted(models: &TrainModels, rule: &Rule, hash: ModelHash) -> Result<(), NotInForce> {
    match rule.outside(&models.text(hash)?) {
        None => Ok(()),
        Some(outside) => Err(NotInForce::OutOfBounds { hash, outside }),
    }
}

/// What the configuration declares, as a model of the store.
///
/// # Errors
///
/// When it cannot be written.
pub fn put_declared(models: &TrainModels, train: &TrainConfig) -> Result<ModelHash, ModelsError> {
    let statement = "Declared by the daemon's configuration.";
    let origin = Origin::written(statement, "dynocar run", None);
    let text = train.text.clone();
    models.put(&NewModel { text, origin, answer_json: None, report_html: None })
}

/// The train's configuration with another model of the store in place of what is declared.
///
/// # Errors
///
/// When the store does not give the model.
pub fn with_model(
    models: &TrainModels,
    train: &TrainConfig,
    hash: ModelHash,
) -> Result<TrainConfig, ModelsError> {
    let (model, track) = models.load(hash)?;
    Ok(TrainConfig {
        model: Arc::new(model),
        track: track.map(Arc::new),
        model_hash: hash,
        ..train.clone()
    })
}
