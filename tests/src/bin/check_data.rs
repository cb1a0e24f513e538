//! Checks Dynocar against a folder of recorded and simulated data: every dataset loads, and the
//! resistance that `dynocar identify` finds is the true one where the truth is known.
//!
//! `dynocar-check-data FOLDER`, with the folders `practice`, `practice-truth`, `independent` and
//! `measured` in it. Exit status 1 when a check fails.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use dynocar::dataset;
use dynocar::identify::{default_estimators, identify, published_samples};
use dynocar_core::train::Davis;
use dynocar_shared::{ParameterSnapshot, PipelineKind, Status, TrainId};
use serde_json::Value;

/// Share of the driven speed range that counts as its thinly driven ends, at each end.
const THIN_END: f64 = 0.1;

fn main() -> ExitCode {
    let Some(folder) = std::env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("expected: dynocar-check-data FOLDER");
        return ExitCode::from(2);
    };
    let mut report = Report::default();
    for dataset in dataset_folders(&folder) {
        let outcome = dataset::load(&dataset).map(|it| format!("{} runs", it.runs.len()));
        report.note(&format!("{} loads", dataset.display()), outcome.map_err(|it| it.to_string()));
    }
    check_resistance(&mut report, &folder.join("practice/p01"), practice_truth(&folder), 0.03);
    check_resistance(&mut report, &folder.join("independent/intermodal"), None, 0.01);
    check_resistance(&mut report, &folder.join("independent/yizhuang-metro"), None, 0.03);
    check_flagged(&mut report, &folder.join("independent/ses-crossing"));
    report.finish()
}

#[derive(Default)]
struct Report {
    passed: usize,
    failed: usize,
}

impl Report {
    fn note(&mut self, what: &str, outcome: Result<String, String>) {
        match outcome {
            Ok(detail) => {
                self.passed += 1;
                println!("ok    {what}: {detail}");
            }
            Err(detail) => {
                self.failed += 1;
                println!("FAIL  {what}: {detail}");
            }
        }
    }

    fn finish(self) -> ExitCode {
        println!("{} passed, {} failed", self.passed, self.failed);
        if self.failed == 0 && self.passed > 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
    }
}

fn dataset_folders(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for group in ["practice", "independent", "measured"] {
        let entries = std::fs::read_dir(folder.join(group)).into_iter().flatten().flatten();
        found.extend(
            entries.map(|entry| entry.path()).filter(|it| it.join("dataset.toml").is_file()),
        );
    }
    found.sort();
    found
}

/// The true resistance of practice run p01, from its truth file.
fn practice_truth(folder: &Path) -> Option<Davis> {
    let text = std::fs::read_to_string(folder.join("practice-truth/p01.json")).ok()?;
    let truth: Value = serde_json::from_str(&text).ok()?;
    let number = |key: &str| truth["true_resistance"][key].as_f64();
    Some(Davis { a: number("a")?, b: number("b")?, c: number("c")? })
}

fn snapshots(dataset: &Path) -> Result<(Davis, Vec<ParameterSnapshot>), String> {
    let dataset = dataset::load(dataset).map_err(|error| error.to_string())?;
    let samples = published_samples(&dataset, TrainId(1));
    let found = default_estimators()
        .iter()
        .map(|settings| identify(&dataset, &samples, settings).map_err(|error| error.to_string()))
        .collect::<Result<Vec<_>, _>>()?;
    Ok((dataset.train.resistance, found))
}

/// The best pipeline's w0 is within `tolerance` of the truth (declared where none is given) over
/// the driven speeds, and the truth within its 95 % band over at least 90 % of them.
fn check_resistance(report: &mut Report, folder: &Path, truth: Option<Davis>, tolerance: f64) {
    let what = format!("{}: resistance within {} %", folder.display(), 100.0 * tolerance);
    let outcome = snapshots(folder).and_then(|(declared, snapshots)| {
        let truth = truth.unwrap_or(declared);
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

/// Largest relative error of w0, and the share of speeds at which the 95 % band holds the truth.
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
    let outcome = snapshots(folder).and_then(|(_, snapshots)| {
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
