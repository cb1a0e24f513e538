//! The resistance that the pipelines find, against the true one.

use std::path::Path;

use dynocar::dataset;
use dynocar_analysis::identify::{default_estimators, identify, published_samples};
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{ParameterSnapshot, PipelineKind, Status, TrainId};
use serde_json::Value;

use super::Report;

/// Share of the driven speed range that counts as thinly driven, at each end.
const THIN_END: f64 = 0.1;

/// Checks every dataset whose true resistance is known, and one whose model lacks an effect.
pub fn check(report: &mut Report, folder: &Path) {
    match practice_truth(folder) {
        Some(truth) => check_resistance(report, &folder.join("practice/p01"), truth, 0.03),
        None => report.note("practice-truth/p01.json", Err("no true resistance found".into())),
    }
    // The simulators' own resistance, in N over the train's mass (the data's README).
    let intermodal = davis_of_force([82_273.0, 0.0, 294.0], 8_580.0);
    check_resistance(report, &folder.join("independent/intermodal"), intermodal, 0.01);
    let metro = davis_of_force([3_947.6, 0.0, 28.893], 278.0);
    check_resistance(report, &folder.join("independent/yizhuang-metro"), metro, 0.03);
    check_flagged(report, &folder.join("independent/ses-crossing"));
}

/// Returns the true resistance of practice run p01, from its truth file.
fn practice_truth(folder: &Path) -> Option<Davis> {
    let text = std::fs::read_to_string(folder.join("practice-truth/p01.json")).ok()?;
    let truth: Value = serde_json::from_str(&text).ok()?;
    let number = |key: &str| truth["true_resistance"][key].as_f64();
    Some(Davis { a: number("a")?, b: number("b")?, c: number("c")? })
}

/// Davis coefficients of a resistance in N, N/(m/s) and N/(m/s)² of a train of a mass in t.
fn davis_of_force(force: [f64; 3], mass_t: f64) -> Davis {
    let weight_kn = TrainModel::weight_kn(1000.0 * mass_t);
    Davis { a: force[0] / weight_kn, b: force[1] / weight_kn, c: force[2] / weight_kn }
}

fn snapshots(dataset: &Path) -> Result<Vec<ParameterSnapshot>, String> {
    let dataset = dataset::load(dataset).map_err(|error| error.to_string())?;
    let samples = published_samples(&dataset, TrainId(1));
    default_estimators()
        .iter()
        .map(|settings| {
            let identified = identify(&dataset, &samples, settings);
            identified.map(|it| it.estimate()).map_err(|error| error.to_string())
        })
        .collect()
}

/// The best pipeline's w0 is within `tolerance` of the truth over
/// the driven speeds, and the truth within its 95 % band over at least 90 % of them.
fn check_resistance(report: &mut Report, folder: &Path, truth: Davis, tolerance: f64) {
    let what = format!("{}: resistance within {} %", folder.display(), 100.0 * tolerance);
    let outcome = snapshots(folder).and_then(|snapshots| {
        let best = snapshots
            .iter()
            .filter(|it| it.status() == Status::Estimated)
            .filter_map(|it| Some((deviation(it, truth)?, it)))
            .min_by(|one, other| one.0.0.total_cmp(&other.0.0));
        let Some(((error, coverage), snapshot)) = best else {
            return Err("no pipeline has status estimated".into());
        };
        let kind = PipelineKind::from_number(snapshot.pipeline_kind).map_or("?", |it| it.name());
        let detail = format!(
            "{kind}: largest error {:.2} %, truth inside the band over {:.0} % of the range",
            100.0 * error,
            100.0 * coverage
        );
        if error <= tolerance && coverage >= 0.9 { Ok(detail) } else { Err(detail) }
    });
    report.note(&what, outcome);
}

/// Returns the largest relative error of w0, and the share of speeds at which the 95 % band holds the truth.
fn deviation(snapshot: &ParameterSnapshot, truth: Davis) -> Option<(f64, f64)> {
    let margin = THIN_END * (snapshot.speed_max_mps - snapshot.speed_min_mps);
    let (low, high) = (snapshot.speed_min_mps + margin, snapshot.speed_max_mps - margin);
    let steps = 200;
    let (mut largest, mut inside) = (0.0_f64, 0);
    for step in 0..=steps {
        let speed_mps = low + (high - low) * f64::from(step) / f64::from(steps);
        let estimate = snapshot.resistance_at(speed_mps)?;
        let true_w0 = truth.w0_n_per_kn(speed_mps);
        let error = (estimate.w0_n_per_kn - true_w0).abs();
        largest = largest.max(error / true_w0);
        inside += i32::from(error <= 1.96 * estimate.w0_std_n_per_kn);
    }
    Some((largest, f64::from(inside) / f64::from(steps + 1)))
}

/// No pipeline that estimates resistance calls its estimate good where the model lacks an effect.
fn check_flagged(report: &mut Report, folder: &Path) {
    let what = format!("{}: no confident wrong answer", folder.display());
    let outcome = snapshots(folder).and_then(|snapshots| {
        let confident: Vec<_> = snapshots
            .iter()
            .filter(|it| it.resistance_at(10.0).is_some() && it.status() == Status::Estimated)
            .filter_map(|it| PipelineKind::from_number(it.pipeline_kind))
            .map(PipelineKind::name)
            .collect();
        if confident.is_empty() {
            Ok("every resistance estimate carries a reservation".into())
        } else {
            Err(format!("without reservation: {}", confident.join(", ")))
        }
    });
    report.note(&what, outcome);
}
