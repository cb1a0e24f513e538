//! What another configuration would have estimated from the same samples.

use dynocar::config::DaemonConfig;
use dynocar::pipelines::build_pipeline;
use dynocar_shared::{ParameterSnapshot, Quantity, TrainId, TrainSample};

/// What a configuration's pipeline answers for a quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct QuantityAnswer {
    /// The train.
    pub train: u64,
    /// The quantity.
    pub quantity: Quantity,
    /// The pipeline that answers.
    pub pipeline: String,
    /// Its snapshot after the last sample.
    pub snapshot: ParameterSnapshot,
}

/// What a configuration answers for every quantity after the last of some samples.
pub fn overlay(config: &DaemonConfig, samples: &[TrainSample]) -> Vec<QuantityAnswer> {
    let mut answered = Vec::new();
    for train in &config.trains {
        let TrainId(id) = train.id;
        if samples.iter().all(|it| it.train_id != id) {
            continue;
        }
        for &quantity in Quantity::ALL {
            let Some(index) = train.answers.pipeline_index(quantity) else { continue };
            let settings = &config.pipelines[index];
            let Ok(mut pipeline) = build_pipeline(settings, index as u32, train) else { continue };
            for sample in samples.iter().filter(|it| it.train_id == id) {
                pipeline.process(sample);
            }
            let (pipeline, snapshot) = (settings.name.clone(), *pipeline.snapshot());
            answered.push(QuantityAnswer { train: id, quantity, pipeline, snapshot });
        }
    }
    answered
}
