//! The daemon's own pipelines over recorded runs, offline and deterministic.

use std::sync::Arc;

use dynocar_core::pipeline::braking::intake::DeclaredGear;
use dynocar_core::pipeline::output::candidates;
use dynocar_core::pipeline::{Pipeline, SettingError};
use dynocar_estimators::EstimatorSettings;
use dynocar_shared::{
    ParameterSnapshot, PipelineKind, Quantity, Reason, SampleField, TrainId, TrainSample,
};

use crate::dataset::{Dataset, Run};

/// Returns the samples of all runs, in file order, as a controller publishes them: with consecutive sequence numbers,
/// each run under a number of its own.
pub fn published_samples(dataset: &Dataset, train: TrainId) -> Vec<TrainSample> {
    samples_of_runs(&dataset.runs, train)
}

/// Returns the samples of some runs as a controller would publish them if it had driven no other runs.
pub fn samples_of_runs<'a>(
    runs: impl IntoIterator<Item = &'a Run>,
    train: TrainId,
) -> Vec<TrainSample> {
    let mut samples = Vec::new();
    for run in runs {
        for sample in &run.samples {
            let sequence = samples.len() as u64 + 1;
            samples.push(TrainSample { sequence, run: run.number, train_id: train.0, ..*sample });
        }
    }
    samples
}

/// Speed in m/s below which a train may be about to stop.
const STOPPING_MPS: f64 = 2.0;

/// Runs one estimator with its settings over the samples; gives the last snapshot, as a controller reads it.
///
/// # Errors
///
/// When a setting is out of range.
pub fn snapshot_after(
    dataset: &Dataset,
    samples: &[TrainSample],
    settings: &EstimatorSettings,
) -> Result<ParameterSnapshot, SettingError> {
    process(dataset, samples, settings, |_, _| {})
}

/// Runs one estimator with its settings over the samples and returns its last estimate. At the last stop another load
/// may board, so that the estimator waits: then the estimate is that on arrival, which holds for the recorded runs.
///
/// # Errors
///
/// When a setting is out of range.
///
/// # Examples
///
/// ```
/// use dynocar_analysis::dataset::Dataset;
/// use dynocar_analysis::identify::{identify, published_samples};
/// use dynocar_estimators::EstimatorSettings;
/// use dynocar_shared::{PipelineKind, Status, TrainId};
///
/// let described = "[dataset]\nname = \"a day\"\n[train]\nfile = \"train.toml\"\n[columns]\n\
///     time = { column = \"t\", unit = \"s\" }\nspeed = { column = \"v\", unit = \"km/h\" }\n\
///     traction_force = { column = \"z\", unit = \"kN\" }\n[[runs]]\nfile = \"monday.csv\"\n";
/// let train = "[train]\nmass_t = 200\nlength_m = 100\nrotating_mass_factor = 0.06\n\
///     [resistance]\na = 1.5\nb = 0.01\nc = 0.0005\n";
/// let monday = "t,v,z\n0,10.0,40\n1,10.6,40\n2,11.2,40\n3,11.8,40\n";
/// let files = [("dataset.toml", described), ("train.toml", train), ("monday.csv", monday)];
/// let dataset = Dataset::load(&files[..])?;
/// let samples = published_samples(&dataset, TrainId(1));
/// let settings = EstimatorSettings::default_of(PipelineKind::TrainKalman).expect("it is built in");
/// // Three seconds determine nothing.
/// let snapshot = identify(&dataset, &samples, &settings)?;
/// assert_eq!(snapshot.status(), Status::Unestimated);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn identify(
    dataset: &Dataset,
    samples: &[TrainSample],
    settings: &EstimatorSettings,
) -> Result<ParameterSnapshot, SettingError> {
    let is_open =
        |snapshot: &ParameterSnapshot| snapshot.reason() == Some(Reason::LoadMayHaveChanged);
    let mut arrived: Option<ParameterSnapshot> = None;
    let last = process(dataset, samples, settings, |before, sample| {
        match (is_open(before), sample.speed_mps < STOPPING_MPS) {
            (false, true) => arrived = Some(*before),
            // The load that drove since was not weighed.
            (true, false) => arrived = None,
            _ => {}
        }
    })?;
    let arrived = arrived.filter(|_| is_open(&last)).unwrap_or(last);
    Ok(ParameterSnapshot {
        sample_sequence: last.sample_sequence,
        samples_used: last.samples_used,
        samples_rejected: last.samples_rejected,
        samples_lost: last.samples_lost,
        rejected_by_reason: last.rejected_by_reason,
        updates: last.updates,
        ..arrived
    })
}

/// Calls `see` with the snapshot before each sample.
fn process(
    dataset: &Dataset,
    samples: &[TrainSample],
    settings: &EstimatorSettings,
    mut see: impl FnMut(&ParameterSnapshot, &TrainSample),
) -> Result<ParameterSnapshot, SettingError> {
    let train = Arc::clone(&dataset.train);
    let estimator = settings.build(&train)?;
    let train_id = samples.first().map_or(TrainId(1), |sample| TrainId(sample.train_id));
    let mut pipeline = Pipeline::new(train_id, 0, train, dataset.track.clone(), estimator);
    for sample in samples {
        see(pipeline.snapshot(), sample);
        pipeline.process(sample);
    }
    Ok(*pipeline.snapshot())
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
/// recordings permit, and the monitor of the model.
pub fn recommended_estimators(dataset: &Dataset) -> Vec<EstimatorSettings> {
    let best = Quantity::ALL.iter().filter(|&&quantity| is_permitted(quantity, dataset));
    let mut kinds: Vec<_> = best.map(|&quantity| candidates(quantity)[0]).collect();
    kinds.push(PipelineKind::ResidualMonitor);
    kinds.dedup();
    kinds.into_iter().filter_map(EstimatorSettings::default_of).collect()
}

/// Brake coefficients need the pressure and the force that the gear makes of it; without data, the other estimators
/// only wait.
fn is_permitted(quantity: Quantity, dataset: &Dataset) -> bool {
    let has_pressure = |run: &Run| {
        run.samples.iter().any(|it| it.get(SampleField::BrakeCylinderPressure).is_some())
    };
    match quantity {
        Quantity::BrakeFriction | Quantity::BrakingRatio => {
            DeclaredGear::from_gear(&dataset.train.brake_gear).is_some()
                && dataset.runs.iter().any(has_pressure)
        }
        Quantity::Resistance | Quantity::Mass | Quantity::Adhesion => true,
    }
}
