//! `dynocar explain`: which undeclared effect explains what the declared model leaves.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use dynocar_core::dataset::Dataset;
use dynocar_core::explain::score::PredictedRun;
use dynocar_core::explain::{Explanation, explain};
use indicatif::{ProgressBar, ProgressStyle};

use super::Failure;
use super::output::write_json;
use crate::dataset;
use crate::grown::write_grown;
use crate::report;
use crate::report::provenance::Provenance;

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
    /// Write a report for people: one HTML page that needs nothing else
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Write the report's plots as SVG files into this folder
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
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
    let bar = progress_bar();
    let progress = |share: f64, what: &str| {
        // Looking again at an earlier choice is no step back.
        bar.set_position(bar.position().max((1000.0 * share) as u64));
        bar.set_message(what.replace('_', " "));
    };
    let explained = explain(&dataset, &progress);
    bar.finish_and_clear();
    let mut explanation = explained.map_err(|error| Failure::Input(error.to_string()))?;
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
    if let Some(file) = &arguments.report {
        write_report(file, &arguments.dataset, &dataset, &explanation)?;
    }
    if let Some(folder) = &arguments.plots {
        write_plots(folder, &dataset, &explanation)?;
    }
    match &arguments.json {
        Some(file) => write_json(file, &explanation.answer)?,
        None => print_answer(&explanation),
    }
    Ok(())
}

/// A bar on standard error while that is a terminal; nothing otherwise.
fn progress_bar() -> ProgressBar {
    let bar = ProgressBar::new(1000);
    let template = "{bar:40} {percent:>3} %  {elapsed:>3}  {msg}";
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

fn write_report(
    file: &Path,
    path: &Path,
    dataset: &Dataset,
    explanation: &Explanation,
) -> Result<(), Failure> {
    let provenance = Provenance::of(path).map_err(|error| Failure::Input(error.to_string()))?;
    let page = report::page(dataset, explanation, provenance)
        .map_err(|error| Failure::Work(format!("{}: {error}", file.display())))?;
    std::fs::write(file, page).map_err(|error| {
        Failure::Work(format!("{}: cannot be written: {error}", file.display()))
    })?;
    eprintln!("report: {}", file.display());
    Ok(())
}

fn write_plots(folder: &Path, dataset: &Dataset, explanation: &Explanation) -> Result<(), Failure> {
    let images = report::images::images(dataset, explanation)
        .map_err(|error| Failure::Work(error.to_string()))?;
    for image in images {
        let path = folder.join(&image.name);
        let written =
            std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&path, image.svg));
        written.map_err(|error| {
            Failure::Work(format!("{}: cannot be written: {error}", path.display()))
        })?;
        eprintln!("plot: {}", path.display());
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
        println!("To settle it: {experiment}");
    }
    let (base, std) = (&answer.base, &answer.base.std);
    let [a, b, c] = [std.a, std.b, std.c].map(|deviation| 1.96 * deviation);
    println!(
        "a = {:.3} ± {a:.3} N/kN, b = {:.4} ± {b:.4}, c = {:.6} ± {c:.6} (95 %, v in m/s)",
        base.a, base.b, base.c
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
