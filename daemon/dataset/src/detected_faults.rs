//! What cannot be true of a recorded run, by the laws that judge samples live.

use std::sync::Arc;

use dynocar_core::plausibility::{DetectedFaults, Plausibility};
use dynocar_model::force::ForceResolver;
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_model::validation::{ValidationLimits, Validator};
use dynocar_shared::{SampleField, TrainSample};

use super::resolved::DATASET_TRAIN;

/// Judges the samples of a recorded run; positions that were integrated from the speed show
/// nothing about it.
pub(super) fn of_samples(
    train: &Arc<TrainModel>,
    track: Option<&Arc<Track>>,
    samples: &[TrainSample],
    is_position_recorded: bool,
) -> DetectedFaults {
    let limits = ValidationLimits::for_train(train.mass_kg);
    let mut validator = Validator::new(DATASET_TRAIN, train.mass_kg, limits);
    let mut resolver = ForceResolver::new(Arc::clone(train), track.cloned());
    let mut plausibility = Plausibility::new(Arc::clone(train));
    for sample in samples {
        let resolved = validator.check(sample).map(|valid| resolver.resolve(&valid));
        let gradient_permille = match &resolved {
            Ok(resolved) => resolved.gradient_permille,
            Err(_) => resolver.stated_gradient_permille(sample),
        };
        let mut sample = *sample;
        if !is_position_recorded {
            sample.valid &= !SampleField::Position.bit();
        }
        plausibility.take(&sample, resolved.map(drop), gradient_permille);
    }
    *plausibility.detected()
}
