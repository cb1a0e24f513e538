//! `dynocar identify`: the daemon's pipelines over recorded runs.

mod answer;
mod runs;

use std::path::{Path, PathBuf};

use clap::Args;
use dynocar_analysis::dataset::{Dataset, Note};
use dynocar_core::pipeline::EstimatorSettings;
use dynocar_core::units::Unit;
use dynocar_shared::TrainId;
use serde::Serialize;

use self::answer::EstimatorAnswer;
use self::runs::{EstimatorSpread, RunAnswer};
use super::Failure;
use super::text::notes;
use crate::dataset;
use crate::identify::{default_estimators, identify, samples_of_runs};
use crate::output::{give, require_file};

/// Learn the train's parameters from recorded runs with the daemon's own pipelines.
#[derive(Debug, Args)]
pub struct IdentifyArguments {
    /// The dataset's folder, or a recording
    dataset: PathBuf,
    /// Only this estimator, as v_mils; all of them by default
    #[arg(long, value_name = "NAME")]
    estimator: Option<String>,
    /// Learn from each run alone, too, and say how much the runs differ
    #[arg(long)]
    per_run: bool,
    /// Use the forces under traction only: for recordings without the friction brake's force
    #[arg(long)]
    traction_only: bool,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
}

/// What is to be learned from.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// The dataset's folder.
    pub dataset: &'a Path,
    /// Only this estimator; all of them by default.
    pub estimator: Option<&'a str>,
    /// From each run alone, too.
    pub per_run: bool,
    /// Use the forces under traction only.
    pub traction_only: bool,
}

/// What was learned.
#[derive(Debug, Serialize)]
pub struct Answer {
    dataset: String,
    /// The unit in which the runs hold the speed.
    #[serde(skip)]
    speed_unit: Unit,
    /// What may spoil the results, the worst first.
    notes: Vec<Note>,
    /// From all runs, one after the other.
    estimators: Vec<EstimatorAnswer>,
    /// From each run alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    runs: Option<Vec<RunAnswer>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    between_runs: Option<Vec<EstimatorSpread>>,
}

/// Runs the estimators and prints what they learned.
///
/// # Errors
///
/// A wrong dataset or estimator name is an input failure.
pub fn execute(arguments: &IdentifyArguments) -> Result<(), Failure> {
    if let Some(file) = &arguments.json {
        require_file(file, "{")?;
    }
    let answer = answer(Question {
        dataset: &arguments.dataset,
        estimator: arguments.estimator.as_deref(),
        per_run: arguments.per_run,
        traction_only: arguments.traction_only,
    })?;
    Ok(give(arguments.json.as_deref(), &answer, || text(&answer))?)
}

/// Runs the estimators over a dataset.
///
/// # Errors
///
/// A wrong dataset or estimator name is an input failure.
pub fn answer(question: Question) -> Result<Answer, Failure> {
    let estimators = chosen_estimators(question.estimator)?;
    let (mut dataset, speed_unit) = dataset::load_with_speed_unit(question.dataset)?;
    if question.traction_only {
        dataset.keep_traction_only();
    }
    let all: Vec<usize> = (0..dataset.runs.len()).collect();
    let learned = learned(&dataset, &all, (&estimators, speed_unit))?;
    let by_run = || by_run(&dataset, (&estimators, speed_unit));
    let runs = if question.per_run { Some(by_run()?) } else { None };
    Ok(Answer {
        dataset: dataset.name.clone(),
        speed_unit,
        notes: dataset.notes(),
        estimators: learned,
        between_runs: runs.as_deref().map(runs::spreads),
        runs,
    })
}

/// What every estimator learns from some runs, one after the other.
fn learned(
    dataset: &Dataset,
    runs: &[usize],
    (estimators, speed_unit): (&[EstimatorSettings], Unit),
) -> Result<Vec<EstimatorAnswer>, Failure> {
    let samples = samples_of_runs(runs.iter().map(|&index| &dataset.runs[index]), TrainId(1));
    let snapshots: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = estimators
            .iter()
            .map(|settings| scope.spawn(|| identify(dataset, &samples, settings)))
            .collect();
        threads.into_iter().map(|thread| thread.join().expect("an estimator")).collect()
    });
    let answer = |(settings, snapshot): (&EstimatorSettings, Result<_, _>)| match snapshot {
        Ok(snapshot) => Ok(EstimatorAnswer::of(settings.kind(), &snapshot, speed_unit)),
        Err(error) => Err(Failure::Input(format!("{error}"))),
    };
    estimators.iter().zip(snapshots).map(answer).collect()
}

fn by_run(
    dataset: &Dataset,
    learners: (&[EstimatorSettings], Unit),
) -> Result<Vec<RunAnswer>, Failure> {
    let one = |(index, run)| Ok(RunAnswer::of(run, learned(dataset, &[index], learners)?));
    dataset.runs.iter().enumerate().map(one).collect()
}

fn chosen_estimators(name: Option<&str>) -> Result<Vec<EstimatorSettings>, Failure> {
    let all = default_estimators();
    let Some(name) = name else { return Ok(all) };
    let chosen: Vec<_> = all.iter().filter(|it| it.kind().name() == name).cloned().collect();
    if chosen.is_empty() {
        let names: Vec<_> = all.iter().map(|settings| settings.kind().name()).collect();
        let names = names.join(", ");
        return Err(Failure::Input(format!("--estimator {name}: expected one of {names}")));
    }
    Ok(chosen)
}

/// The answer for people.
pub fn text(answer: &Answer) -> String {
    let mut text = format!("{}\n{}", answer.dataset, notes(&answer.notes));
    for it in &answer.estimators {
        let reason = if it.reason == "none" { String::new() } else { format!(", {}", it.reason) };
        let rejected: u32 = it.samples.rejected.values().sum();
        text += &format!(
            "\n{} ({}{reason}): {} samples used, {rejected} rejected, {} lost, {} updates\n",
            it.name, it.status, it.samples.used, it.samples.lost, it.updates
        );
        for (reason, count) in &it.samples.rejected {
            text += &format!("    rejected as {reason}: {count}\n");
        }
        for (name, value) in &it.values {
            let std = it.std.get(name).copied().unwrap_or(f64::NAN);
            text += &format!("    {name:<24} {value:>12.6} ± {:.6}\n", 1.96 * std);
        }
        for point in &it.resistance_shown {
            let at = answer.speed_unit.from_base(point.speed_mps);
            let name = format!("w0 at {at:>4.0} {}", answer.speed_unit.name());
            let (w0, half) = (point.w0_n_per_kn, 1.96 * point.std);
            text += &format!("    {name:<24} {w0:>12.4} ± {half:.4} N/kN\n");
        }
    }
    if let Some(runs) = &answer.runs {
        text += &runs::report(runs, answer.speed_unit);
    }
    text + "\n± is the half width of the 95 % interval\n"
}
