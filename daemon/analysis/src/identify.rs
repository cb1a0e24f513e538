//! The daemon's own pipelines over recorded runs, offline and deterministic.

use std::sync::Arc;

use dynocar_core::pipeline::braking::intake::DeclaredGear;
use dynocar_core::pipeline::output::candidates;
use dynocar_core::pipeline::{Pipeline, SettingError};
use dynocar_estimators::EstimatorSettings;
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::{
    ParameterSnapshot, PipelineKind, Quantity, Reason, SampleField, TrainId, TrainSample,
};

use crate::dataset::{DATASET_TRAIN, Dataset, Run};

/// Returns the samples of all runs, in file order, as a controller publishes them: with consecutive sequence numbers,
/// each run under a number of its own.
pub fn published_samples(dataset: &Dataset, train: TrainId) -> Vec<TrainSample> {
    let samples = dataset.runs.iter().flat_map(|run| published(run, train)).zip(1..);
    samples.map(|(sample, sequence)| TrainSample { sequence, ..sample }).collect()
}

/// Returns the samples of a run with its number, for a train.
fn published(run: &Run, train: TrainId) -> impl Iterator<Item = TrainSample> {
    run.samples.iter().map(move |it| TrainSample { run: run.number, train_id: train.0, ..*it })
}

/// Speed in m/s below which a train may be about to stop.
const STOPPING_MPS: f64 = 2.0;

/// One estimator in a pipeline of its own, which learns from samples as in the daemon.
///
/// # Examples
///
/// ```
/// use dynocar_analysis::dataset::Dataset;
/// use dynocar_analysis::identify::Identification;
/// use dynocar_estimators::EstimatorSettings;
/// use dynocar_shared::{PipelineKind, Status};
///
/// let described = "[dataset]\nname = \"a day\"\n[train]\nfile = \"train.toml\"\n[columns]\n\
///     time = { column = \"t\", unit = \"s\" }\nspeed = { column = \"v\", unit = \"km/h\" }\n\
///     traction_force = { column = \"z\", unit = \"kN\" }\n[[runs]]\nfile = \"monday.csv\"\n";
/// let train = "[train]\nmass_t = 200\nlength_m = 100\nrotating_mass_factor = 0.06\n\
///     [resistance]\na = 1.5\nb = 0.01\nc = 0.0005\n";
/// let monday = "t,v,z\n0,10.0,40\n1,10.6,40\n2,11.2,40\n3,11.8,40\n";
/// let files = [("dataset.toml", described), ("train.toml", train), ("monday.csv", monday)];
/// let dataset = Dataset::load(&files[..])?;
/// let settings = EstimatorSettings::default_of(PipelineKind::TrainKalman).expect("it is built in");
/// let mut identification = Identification::new(&dataset.train, &dataset.track, &settings)?;
/// identification.update_with_run(&dataset.runs[0]);
/// // Three seconds determine nothing.
/// assert_eq!(identification.estimate().status(), Status::Unestimated);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Identification {
    pipeline: Pipeline,
    /// The snapshot on arrival at the last stop.
    arrived: Option<ParameterSnapshot>,
}

impl Identification {
    /// Before the first sample of [`DATASET_TRAIN`] on a line, which need not be known.
    ///
    /// # Errors
    ///
    /// When a setting is out of range.
    pub fn new(
        train: &Arc<TrainModel>,
        track: &Option<Arc<Track>>,
        settings: &EstimatorSettings,
    ) -> Result<Self, SettingError> {
        let (train, track) = (Arc::clone(train), track.clone());
        let estimator = settings.build(&train)?;
        let pipeline = Pipeline::new(DATASET_TRAIN, 0, train, track, estimator);
        Ok(Identification { pipeline, arrived: None })
    }

    /// Takes the next sample.
    pub fn update(&mut self, sample: &TrainSample) {
        let before = self.pipeline.snapshot();
        match (is_open(before), sample.speed_mps < STOPPING_MPS) {
            (false, true) => self.arrived = Some(*before),
            // The load that drove since was not weighed.
            (true, false) => self.arrived = None,
            _ => {}
        }
        self.pipeline.process(sample);
    }

    /// Takes the samples of the next run, which follow those of the last one without a gap of the sequence number.
    pub fn update_with_run(&mut self, run: &Run) {
        let first = self.pipeline.snapshot().sample_sequence + 1;
        for (sample, sequence) in published(run, DATASET_TRAIN).zip(first..) {
            self.update(&TrainSample { sequence, ..sample });
        }
    }

    /// Returns the last snapshot, as a controller reads it.
    pub fn snapshot(&self) -> &ParameterSnapshot {
        self.pipeline.snapshot()
    }

    /// Returns the last estimate. At the last stop another load may board, so that the estimator waits: then the
    /// estimate is that on arrival, which holds for the recorded runs.
    pub fn estimate(&self) -> ParameterSnapshot {
        let last = *self.snapshot();
        ParameterSnapshot {
            sample_sequence: last.sample_sequence,
            samples_used: last.samples_used,
            samples_rejected: last.samples_rejected,
            samples_lost: last.samples_lost,
            rejected_by_reason: last.rejected_by_reason,
            updates: last.updates,
            ..self.arrived.filter(|_| is_open(&last)).unwrap_or(last)
        }
    }
}

fn is_open(snapshot: &ParameterSnapshot) -> bool {
    snapshot.reason() == Some(Reason::LoadMayHaveChanged)
}

/// Runs one estimator with its settings over samples, and returns it.
///
/// # Errors
///
/// When a setting is out of range.
pub fn identify(
    dataset: &Dataset,
    samples: &[TrainSample],
    settings: &EstimatorSettings,
) -> Result<Identification, SettingError> {
    let mut identification = Identification::new(&dataset.train, &dataset.track, settings)?;
    samples.iter().for_each(|sample| identification.update(sample));
    Ok(identification)
}

/// Returns every kind of estimator that learns something, with its default settings.
pub fn default_estimators() -> Vec<EstimatorSettings> {
    PipelineKind::ALL
        .iter()
        .filter(|&&kind| kind != PipelineKind::Echo)
        .filter_map(|&kind| EstimatorSettings::default_of(kind))
        .collect()
}

/// Returns the recommended estimators: the best measured one for each quantity that the train's file and the
/// recordings permit, and the monitor of the model. Without the pressure of a brake cylinder in the recordings, and the
/// force that the declared gear makes of it, brake coefficients' estimators would only wait.
pub fn recommended_estimators(train: &TrainModel, has_pressure: bool) -> Vec<EstimatorSettings> {
    let is_permitted = |quantity| match quantity {
        Quantity::BrakeFriction | Quantity::BrakingRatio => {
            has_pressure && DeclaredGear::from_gear(&train.brake_gear).is_some()
        }
        Quantity::Resistance | Quantity::Mass | Quantity::Adhesion => true,
    };
    let best = Quantity::ALL.iter().filter(|&&quantity| is_permitted(quantity));
    let mut kinds: Vec<_> = best.map(|&quantity| candidates(quantity)[0]).collect();
    kinds.push(PipelineKind::ResidualMonitor);
    kinds.dedup();
    kinds.into_iter().filter_map(EstimatorSettings::default_of).collect()
}

/// Returns whether a run records the pressure of a brake cylinder.
pub fn has_pressure(run: &Run) -> bool {
    run.samples.iter().any(|it| it.get(SampleField::BrakeCylinderPressure).is_some())
}
