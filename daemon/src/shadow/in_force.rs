//! The model that a train has when the daemon starts.

use std::sync::Arc;
use std::time::SystemTime;

use tracing::{info, warn};

use super::rule::Rule;
use crate::config::{DaemonConfig, TrainConfig};
use crate::models::{ModelHash, ModelsError, Store, TrainModels, UtcSecond};

/// Most generations of models that a search for an ancestor goes back.
const ANCESTORS_MAX: usize = 10_000;

/// Puts the declared model of each train into the store, and gives each train the model that the store's decisions put
/// in force. Where the store cannot be read, the declared model stays in force, and the log says why.
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
    let declared = models.put_declared(&train.text, UtcSecond::from_time(SystemTime::now()))?;
    let Some(hash) = models.in_force()? else { return Ok(()) };
    permitted(models, rule, hash)?;
    let (id, added) = (train.id.0, models.stored(hash)?.origin.adds());
    *train = with_model(models, train, hash)?;
    info!(train = id, model = %hash, "in force, as decided: {added}");
    if !grew_from(models, hash, declared) {
        warn!(train = id, "model {hash} grew from other files than those that are declared now");
    }
    Ok(())
}

/// Returns whether a model is another, or grew from it; false where the store does not say.
fn grew_from(models: &TrainModels, model: ModelHash, root: ModelHash) -> bool {
    let parent = |hash: &ModelHash| models.stored(*hash).ok()?.origin.parent;
    // No history is so long, unless somebody wrote one that leads in a circle.
    std::iter::successors(Some(model), parent).take(ANCESTORS_MAX).any(|hash| hash == root)
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

/// Checks whether a model may come in force, for decisions of persons and rules alike.
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

/// Returns the train's configuration with another model of the store in place of the declaration.
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
