//! The open-loop prediction of the declared model over the practice runs, against the error that
//! their truth files state for it.

use std::path::Path;
use std::sync::Arc;

use dynocar::dataset;
use dynocar_analysis::dataset::{Dataset, Role, Run};
use dynocar_core::pipeline::admission::Admission;
use dynocar_model::force::ForceResolver;
use dynocar_model::simulate::{
    OpenLoopRecording, Prediction, QuadraticForces, Restart, SpeedError,
};
use dynocar_shared::TrainId;
use serde_json::Value;

use super::Report;

/// Largest relative difference from the stated error.
const TOLERANCE: f64 = 0.03;

/// Checks all five practice datasets with both metrics.
pub fn check(report: &mut Report, folder: &Path) {
    for name in ["p01", "p02", "p03", "p04", "p05"] {
        for (metric, restart) in [("full_run", Restart::FullRun), ("window60", Restart::WINDOW_60)]
        {
            let outcome = compare(folder, name, metric, restart);
            report.note(&format!("{name}: declared model, {metric}"), outcome);
        }
    }
}

fn compare(folder: &Path, name: &str, metric: &str, restart: Restart) -> Result<String, String> {
    let truth = folder.join(format!("practice-truth/{name}.json"));
    let truth = std::fs::read_to_string(&truth).map_err(|error| error.to_string())?;
    let truth: Value = serde_json::from_str(&truth).map_err(|error| error.to_string())?;
    let stated = truth["oracle"]["metrics"][metric]["declared"]
        .as_f64()
        .ok_or("the truth file states no error of the declared model")?;
    let dataset =
        dataset::load(&folder.join("practice").join(name)).map_err(|error| error.to_string())?;
    let mut error = SpeedError::default();
    for run in dataset.with_role(Role::Holdout) {
        error = error + prediction_error(&dataset, run, restart)?;
    }
    let found = error.rmse_mps().ok_or("no moving sample")?;
    let detail = format!("{found:.4} m/s, stated {stated:.4} m/s");
    if (found / stated - 1.0).abs() <= TOLERANCE { Ok(detail) } else { Err(detail) }
}

fn prediction_error(dataset: &Dataset, run: &Run, restart: Restart) -> Result<SpeedError, String> {
    let train = &dataset.train;
    let train_id = TrainId(run.samples.first().map_or(0, |sample| sample.train_id));
    let mut admission = Admission::new(train_id, Arc::clone(train));
    let mut resolver = ForceResolver::new(Arc::clone(train), dataset.track.clone());
    let resolved = run
        .samples
        .iter()
        .filter_map(|sample| Some(resolver.resolve(&admission.validate(sample).ok()?)))
        .collect();
    let recording =
        OpenLoopRecording::new(resolved).map_err(|error| format!("{}: {error}", run.file))?;
    let model = QuadraticForces::declared(&recording, train.resistance);
    let mut prediction = Prediction::new();
    prediction.simulate(&recording, &model, restart);
    Ok(SpeedError::new(&recording, &prediction))
}
