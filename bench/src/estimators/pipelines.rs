//! Every kind of pipeline over a run of the demonstration dataset, from sample to snapshot.

use std::sync::Arc;

use dynocar_analysis::dataset::{DATASET_TRAIN, DatasetError, DatasetHead};
use dynocar_estimators::EstimatorSettings;
use dynocar_model::track::Track;
use dynocar_model::train::{BrakeGear, TrainModel};
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainSample};

use super::measure::{Agreement, Case, Contender};
use crate::rig::pipelines::default_pipeline;

/// The files of the dataset that is measured on.
const FILES: &[(&str, &str)] = &[
    ("dataset.toml", include_str!("../../../config/demo/dataset.toml")),
    ("train.toml", include_str!("../../../config/demo/train.toml")),
    ("track.toml", include_str!("../../../config/demo/track.toml")),
    ("runs/01.csv", include_str!("../../../config/demo/runs/01.csv")),
];

/// A run with its train and line.
pub struct DemoRun {
    /// The train, with a brake gear, so that brake pipelines have something to learn.
    pub train: Arc<TrainModel>,
    track: Option<Arc<Track>>,
    samples: Vec<TrainSample>,
}

impl DemoRun {
    /// The first run of the dataset.
    ///
    /// # Errors
    ///
    /// When the dataset is wrong.
    pub fn read() -> Result<Arc<Self>, DatasetError> {
        let head = DatasetHead::open(FILES)?;
        let run = head.read_run(FILES, 0)?;
        let mut train = (*head.train).clone();
        train.brake_gear = BrakeGear {
            cylinder_diameter_mm: Some(254.0),
            disc_radius_mm: Some(240.0),
            wheel_radius_mm: Some(460.0),
            efficiency: Some(0.9),
            ratio: Some(2.55),
            friction: Some(0.35),
            pads: Some(48.0),
            friction_brake: None,
        };
        Ok(Arc::new(DemoRun { train: Arc::new(train), track: head.track, samples: run.samples }))
    }

    /// Runs a pipeline over all samples.
    fn process(&self, kind: PipelineKind) -> ParameterSnapshot {
        let mut pipeline = default_pipeline(kind, DATASET_TRAIN, &self.train, self.track.clone());
        for sample in &self.samples {
            std::hint::black_box(pipeline.process(sample));
        }
        *pipeline.snapshot()
    }
}

/// One case for each kind that can be built.
pub fn cases(run: &Arc<DemoRun>) -> Vec<Case> {
    let can_be_built = |kind: &&PipelineKind| EstimatorSettings::default_of(**kind).is_some();
    let all = PipelineKind::ALL.iter().filter(can_be_built);
    all.map(|&kind| {
        let name = format!("pipeline {kind}");
        let ours = Contender::new("ours", run.samples.len(), run, move |run| {
            let snapshot = run.process(kind);
            vec![snapshot.samples_used as f64, snapshot.updates as f64]
        });
        Case::new(name, Agreement::Absolute(0.0), ours)
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pipeline_uses_samples_of_the_run() {
        let run = DemoRun::read().unwrap();
        let mut cases = cases(&run);
        assert!(cases.len() > 10);
        for case in &mut cases {
            let answer = (case.ours.pass)();
            assert!(answer[0] > 0.0, "{}: {answer:?}", case.name);
        }
    }
}
