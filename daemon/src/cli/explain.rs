//! `dynocar explain`: which undeclared effect explains what the declared model leaves.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use dynocar_core::explain::score::PredictedRun;
use dynocar_core::explain::{Explanation, explain};
use indicatif::{ProgressBar, ProgressStyle};

use super::Failure;
use super::output::write_json;
use crate::dataset;
use crate::grown::write_grown;

/// Find what the declared model leaves, trace it to an effect, and score the grown model.
#[derive(Debug, Args)]
pub struct ExplainArguments {
    /// The dataset's folder
    dataset: PathBuf,
    /// Use the forces under traction only: for recordings without the friction brake's force
    #[arg(long)]
    traction_only: bool,
    /// Write the answer for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the speeds that the model with the effect predicts for the holdout runs
    #[arg(long, value_name = "DIR")]
    predictions: Option<PathBuf>,
    /// Write the grown model as train.toml and track.toml into this folder
    #[arg(long, value_name = "DIR")]
    grown: Option<PathBuf>,
}

/// Explains a dataset and prints the answer.
///
/// # Errors
///
/// A wrong dataset is an input failure.
pub fn execute(arguments: &ExplainArguments) -> Result<(), Failure> {
    let mut dataset =
        dataset::load(&arguments.dataset).map_err(|error| Failure::Input(error.to_string()))?;
    if arguments.traction_only {
        dataset.keep_traction_only();
    }
    let bar = ProgressBar::new(1000);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent:>3} % {msg}") {
        bar.set_style(style);
    }
    let progress = |share: f64, what: &str| {
        bar.set_position((1000.0 * share) as u64);
        bar.set_message(what.to_string());
    };
    let mut explanation =
        explain(&dataset, &progress).map_err(|error| Failure::Input(error.to_string()))?;
    bar.finish_and_clear();
    if let Some(folder) = &arguments.predictions {
        explanation.answer.predictions = write_predictions(folder, &explanation)?;
    }
    if let Some(folder) = &arguments.grown {
        let grown = write_grown(&arguments.dataset, &explanation, folder)
            .map_err(|error| Failure::Work(error.to_string()))?;
        for file in &grown.files {
            eprintln!("grown model: {}", file.display());
        }
        if !grown.not_expressed.is_empty() {
            let kinds = grown.not_expressed.join(", ");
            eprintln!("the files cannot express {kinds}: use the answer of --json for it");
        }
    }
    match &arguments.json {
        Some(file) => write_json(file, &explanation.answer)?,
        None => print_answer(&explanation),
    }
    Ok(())
}

/// Writes one file for each holdout run; gives the files by run.
fn write_predictions(
    folder: &Path,
    explanation: &Explanation,
) -> Result<BTreeMap<String, String>, Failure> {
    let is_holdout =
        |run: &&PredictedRun| explanation.holdout.iter().any(|holdout| holdout.file == run.file);
    let mut files = BTreeMap::new();
    for run in explanation.predictions.iter().filter(is_holdout) {
        let name = run.file.rsplit('/').next().unwrap_or(&run.file);
        let path = folder.join(name);
        let failed = |error: std::io::Error| {
            Failure::Work(format!("{}: cannot be written: {error}", path.display()))
        };
        std::fs::create_dir_all(folder).map_err(failed)?;
        let mut text = String::from("time_s,speed_mps\n");
        for (time_s, speed_mps) in run.time_s.iter().zip(&run.speed_mps) {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{time_s:.3},{speed_mps:.4}");
        }
        std::fs::write(&path, text).map_err(failed)?;
        files.insert(run.file.clone(), path.display().to_string());
    }
    Ok(files)
}

fn print_answer(explanation: &Explanation) {
    let answer = &explanation.answer;
    println!("{}", answer.statement);
    if let Some(experiment) = &answer.experiment {
        println!("{experiment}");
    }
    let base = &answer.base;
    println!(
        "a = {:.3} ± {:.3} N/kN, b = {:.4} ± {:.4}, c = {:.6} ± {:.6} (v in m/s)",
        base.a, base.std.a, base.b, base.std.b, base.c, base.std.c
    );
    if let (Some(before), Some(after)) = (answer.rmse_before, answer.rmse_after) {
        println!("holdout runs, open loop: {before:.3} m/s before, {after:.3} m/s after");
    }
    for considered in &answer.considered {
        let evidence =
            considered.evidence.map_or("     -".into(), |evidence| format!("{evidence:6.0}"));
        println!("  {evidence}  {:20} {}", considered.kind, considered.remark);
    }
}
