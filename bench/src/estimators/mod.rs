//! Time of an update of every estimator and every pipeline. The pipelines, from sample to snapshot, and the filter of
//! the mass go over a run of the demonstration dataset.
//!
//! - [`measure`]: rounds, medians, the table; another build of the program compared with this one
//! - [`resistance`], [`braking`]: parts of estimators

pub mod braking;
pub mod measure;
pub mod resistance;

use std::hint::black_box;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;

use clap::Args;
use dynocar_analysis::dataset::{DATASET_TRAIN, DatasetError, DatasetHead};
use dynocar_estimators::EstimatorSettings;
use dynocar_estimators::wang::MassKalmanSettings;
use dynocar_estimators::wang::bias_bank::{BiasBank, Dynamics};
use dynocar_estimators::wang::force_model::LineResistance;
use dynocar_estimators::wang::known_motion::{Inertia, KnownMotion};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainSample};
use serde_json::json;

use self::measure::{Effort, EstimatorCase};
use crate::ending::until_due;
use crate::output::{BenchError, OutputArguments, Record, containing, table};
use crate::papers;
use crate::rig::{default_pipeline, resolving};

/// Time of an update of every estimator and every pipeline.
#[derive(Debug, Args)]
pub struct EstimatorsArguments {
    /// Few rounds: a check that everything runs, not a measurement
    #[arg(long)]
    quick: bool,
    /// Only the cases whose name contains this, as rls
    #[arg(long, value_name = "TEXT")]
    case: Option<String>,
    /// Another build of this program, measured by turns with this one
    #[arg(long, value_name = "PROGRAM", requires = "case", conflicts_with = "quick")]
    beside: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArguments,
}

impl EstimatorsArguments {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// When there is no such case, or the other build does not measure.
    pub fn run(&self) -> Result<(), BenchError> {
        let text = self.case.as_deref().unwrap_or_default();
        if let Some(other) = &self.beside {
            let cases = measure::against(other, text)?;
            return self.output.give(&cases, || table(&cases));
        }
        let effort = if self.quick { Effort::QUICK } else { Effort::FULL };
        let chosen = containing("--case", text, cases()?, |case| case.name.clone())?;
        let records: Vec<Record> = until_due(chosen).map(|it| it.measure(&effort)).collect();
        self.output.give(&json!({ "cases": records }), || table(&records))
    }
}

/// Returns every case, in the order of the table.
///
/// # Errors
///
/// When the demonstration dataset is wrong.
fn cases() -> Result<Vec<EstimatorCase>, DatasetError> {
    let mut cases = resistance::least_squares();
    cases.extend(resistance::trajectories());
    cases.extend(braking::cases());
    cases.extend(pipelines()?);
    Ok(cases)
}

/// The files of the dataset over which the pipelines run.
const FILES: &[(&str, &str)] = &[
    ("dataset.toml", include_str!("../../../config/demo/dataset.toml")),
    ("train.toml", include_str!("../../../config/demo/train.toml")),
    ("track.toml", include_str!("../../../config/demo/track.toml")),
    ("runs/01.csv", include_str!("../../../config/demo/runs/01.csv")),
];

/// A run with its train, which has a brake gear, so that brake pipelines have something to learn, and its line.
struct DemoRun {
    train: Arc<TrainModel>,
    track: Option<Arc<Track>>,
    samples: Vec<TrainSample>,
}

impl DemoRun {
    /// Returns the first run of the dataset.
    ///
    /// # Errors
    ///
    /// When the dataset is wrong.
    fn read() -> Result<Rc<Self>, DatasetError> {
        let head = DatasetHead::open(FILES)?;
        let run = head.read_run(FILES, 0)?;
        let mut train = (*head.train).clone();
        train.brake_gear = papers::braking::train().brake_gear;
        Ok(Rc::new(DemoRun { train: Arc::new(train), track: head.track, samples: run.samples }))
    }

    /// Runs a pipeline over all samples.
    fn process(&self, kind: PipelineKind) -> ParameterSnapshot {
        let mut pipeline = default_pipeline(kind, DATASET_TRAIN, &self.train, self.track.clone());
        for sample in &self.samples {
            black_box(pipeline.process(sample));
        }
        *pipeline.snapshot()
    }

    /// Returns the motion at every sample that has one.
    fn motions(&self) -> Vec<KnownMotion> {
        let mut resolve = resolving(DATASET_TRAIN, &self.train, self.track.clone());
        let motion = |sample| KnownMotion::from_sample(&resolve(sample)?).ok();
        self.samples.iter().filter_map(motion).collect()
    }
}

/// Returns every kind that can be built.
fn kinds() -> impl Iterator<Item = PipelineKind> {
    let can_be_built = |kind: &PipelineKind| EstimatorSettings::default_of(*kind).is_some();
    PipelineKind::ALL.iter().copied().filter(can_be_built)
}

/// Returns the filter of the mass, and one case for each kind of pipeline.
///
/// # Errors
///
/// When the dataset is wrong.
fn pipelines() -> Result<Vec<EstimatorCase>, DatasetError> {
    let run = DemoRun::read()?;
    let of = |kind: PipelineKind| {
        let run = Rc::clone(&run);
        EstimatorCase::new(format!("pipeline {kind}"), run.samples.len(), move || run.process(kind))
    };
    Ok(std::iter::once(mass_filter(&run)).chain(kinds().map(of)).collect())
}

/// Variance of a measured speed in (m/s)².
const SPEED_VARIANCE: f64 = 4e-4;
/// Time in s between samples.
const STEP_S: f64 = 0.2;

/// Eight behaviours of a bias side by side.
fn mass_filter(run: &DemoRun) -> EstimatorCase {
    let train = &run.train;
    let dynamics = Dynamics {
        resistance: LineResistance::declared(train),
        inertia: Inertia::from_train(train),
    };
    let motions = run.motions();
    EstimatorCase::new("mass Kalman step, 8 behaviours", motions.len() - 1, move || {
        let models = MassKalmanSettings::default().bias_models();
        let mut bank = BiasBank::new(dynamics, models, (1.0, 0.2), 3000.0);
        bank.restart_speed(motions[0].speed_mps, SPEED_VARIANCE);
        for pair in motions.windows(2) {
            bank.predict(&pair[0], &pair[1], STEP_S);
            bank.measure(pair[1].speed_mps, SPEED_VARIANCE).expect("a sound speed");
        }
        bank.moments()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_runs_and_has_a_name_of_its_own() {
        let mut cases = super::cases().unwrap();
        let mut names: Vec<String> = cases.iter().map(|case| case.name.clone()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), cases.len());
        assert!(cases.iter_mut().all(|case| !case.time(1).is_zero()));
    }

    #[test]
    fn every_pipeline_uses_samples_of_the_run_and_the_train_moves_in_most() {
        let run = DemoRun::read().unwrap();
        assert!(kinds().count() > 10);
        for kind in kinds() {
            assert!(run.process(kind).samples_used > 0, "{kind}");
        }
        assert!(2 * run.motions().len() > run.samples.len());
    }
}
