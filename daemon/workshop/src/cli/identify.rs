//! `dynocar identify`: the daemon's pipelines over recorded runs.

mod runs;

use std::path::PathBuf;

use clap::Args;
use dynocar_analysis::dataset::{Dataset, DatasetDiagnostic};
use dynocar_core::plausibility::Severity;
use dynocar_estimators::EstimatorSettings;
use dynocar_model::train::PowerTrain;
use dynocar_model::units::Unit;
use dynocar_shared::{HALF_95, Parameter, TrainId, schema};
use serde::Serialize;

use self::runs::{EstimatorAnswer, EstimatorSpread, RunAnswer};
use crate::dataset;
use crate::run_facts::diagnostics;
use dynocar::cli::Failure;
use dynocar::dataset::SourceArguments;
use dynocar::output::{give, require_files};
use dynocar_analysis::identify::{
    default_estimators, identify, recommended_estimators, samples_of_runs,
};

/// Estimate resistance, mass, adhesion and friction from recorded runs.
#[derive(Debug, Args)]
pub struct IdentifyArguments {
    #[command(flatten)]
    question: Question,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
}

/// Runs to learn from, and estimators to learn with.
#[derive(Clone, Debug, Args)]
pub struct Question {
    /// The runs
    #[command(flatten)]
    pub source: SourceArguments,
    /// This estimator, as v_mils; may be given several times [default: the recommended ones]
    #[arg(long, value_name = "NAME")]
    pub estimator: Vec<String>,
    /// All estimators, the papers' methods too
    #[arg(long)]
    pub all: bool,
    /// Learn from each run alone, too, and say how much the runs differ
    #[arg(long)]
    pub per_run: bool,
    /// Use the forces under traction only: for recordings without the friction brake's force
    #[arg(long)]
    pub traction_only: bool,
}

/// Estimates of all estimators.
#[derive(Debug, Serialize)]
pub struct IdentifyAnswer {
    dataset: String,
    /// The unit in which the runs hold the speed.
    #[serde(skip)]
    speed_unit: Unit,
    /// Diagnostics that may spoil the results, the worst first.
    #[serde(rename = "notes")]
    diagnostics: Vec<DatasetDiagnostic>,
    /// From all runs, one after the other.
    estimators: Vec<EstimatorAnswer>,
    /// Estimators in addition to the recommended ones, where nobody chose.
    not_run: Vec<&'static str>,
    /// From each run alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    runs: Option<Vec<RunAnswer>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    between_runs: Option<Vec<EstimatorSpread>>,
}

/// Runs the estimators and prints their estimates.
///
/// # Errors
///
/// A wrong dataset or estimator name is an input failure.
pub fn execute(arguments: &IdentifyArguments) -> Result<(), Failure> {
    require_files(&[(&arguments.json, "{")])?;
    let answer = answer(&arguments.question)?;
    Ok(give(arguments.json.as_deref(), &answer, || text(&answer))?)
}

/// Runs the estimators over a dataset.
///
/// # Errors
///
/// A wrong dataset or estimator name is an input failure; all and some by name exclude each other.
pub fn answer(question: &Question) -> Result<IdentifyAnswer, Failure> {
    let named = match (question.all, &question.estimator[..]) {
        (true, []) => Some(default_estimators()),
        (true, names) => {
            let names = names.join(", ");
            return Err(Failure::Input(format!(
                "--all: expected no --estimator with it, got {names}"
            )));
        }
        (false, []) => None,
        (false, names) => Some(named_estimators(names)?),
    };
    let (mut dataset, speed_unit) = dataset::load_with_speed_unit(question.source.source())?;
    let is_chosen = named.is_some();
    let estimators = named.unwrap_or_else(|| recommended_estimators(&dataset));
    if question.traction_only {
        dataset.keep_traction_only();
    }
    let all: Vec<usize> = (0..dataset.runs.len()).collect();
    let mut learned = learned(&dataset, &all, (&estimators, speed_unit))?;
    let by_run = || by_run(&dataset, (&estimators, speed_unit));
    let mut runs = if question.per_run { Some(by_run()?) } else { None };
    let mut diagnostics = dataset.diagnostics();
    let of_runs = runs.iter_mut().flatten().flat_map(RunAnswer::estimators);
    for answer in learned.iter_mut().chain(of_runs) {
        if dataset.is_efficiency_unknown() {
            answer.widen_mass(PowerTrain::EFFICIENCY_STD / PowerTrain::USUAL.efficiency);
        }
        if let Some(it) = diagnostics.iter().find(|it| it.severity == Severity::Fundamental) {
            answer.refuse(it.code);
        }
    }
    let declared_kg = dataset.runs.last().map_or(dataset.train.mass_kg, |run| run.mass_kg);
    diagnostics.extend(learned.iter().find_map(|it| it.contradiction(declared_kg)));
    Ok(IdentifyAnswer {
        dataset: dataset.name.clone(),
        speed_unit,
        diagnostics,
        estimators: learned,
        not_run: if is_chosen { Vec::new() } else { others(&estimators) },
        between_runs: runs.as_deref().map(runs::spreads),
        runs,
    })
}

/// Returns the estimates of every estimator from some runs, one after the other.
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
        Ok(snapshot) => Ok(EstimatorAnswer::new(settings.kind(), &snapshot, speed_unit)),
        Err(error) => Err(Failure::Input(format!("{error}"))),
    };
    estimators.iter().zip(snapshots).map(answer).collect()
}

fn by_run(
    dataset: &Dataset,
    learners: (&[EstimatorSettings], Unit),
) -> Result<Vec<RunAnswer>, Failure> {
    let one = |(index, run)| Ok(RunAnswer::new(run, learned(dataset, &[index], learners)?));
    dataset.runs.iter().enumerate().map(one).collect()
}

fn named_estimators(names: &[String]) -> Result<Vec<EstimatorSettings>, Failure> {
    let all = default_estimators();
    let mut chosen: Vec<EstimatorSettings> = Vec::new();
    for name in names {
        let Some(settings) = all.iter().find(|it| it.kind().name() == name) else {
            let names: Vec<_> = all.iter().map(|settings| settings.kind().name()).collect();
            let names = names.join(", ");
            return Err(Failure::Input(format!("--estimator {name}: expected one of {names}")));
        };
        if chosen.iter().all(|it| it.kind() != settings.kind()) {
            chosen.push(settings.clone());
        }
    }
    Ok(chosen)
}

/// Returns the names of all but some estimators.
fn others(estimators: &[EstimatorSettings]) -> Vec<&'static str> {
    let is_other =
        |it: &EstimatorSettings| estimators.iter().all(|other| other.kind() != it.kind());
    default_estimators().iter().filter(|it| is_other(it)).map(|it| it.kind().name()).collect()
}

/// Returns the answer for people.
pub fn text(answer: &IdentifyAnswer) -> String {
    let mut text = format!("{}\n{}", answer.dataset, diagnostics(&answer.diagnostics));
    if answer.diagnostics.iter().any(|it| it.severity == Severity::Fundamental) {
        return text
            + "\nNo value is printed: the data cannot be true as described. Set right what is named above.\n";
    }
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
            let (half, unit) = (HALF_95 * std, unit_of(name));
            // The uncertain part is shown to two digits.
            let decimals = (1.0 - half.log10().floor()).clamp(0.0, 9.0) as usize;
            text += &format!("    {name:<24} {value:>12.decimals$} ± {half:.decimals$}{unit}\n");
        }
        for point in &it.resistance_shown {
            let at = answer.speed_unit.from_base(point.speed_mps);
            let name = format!("w0 at {at:>4.0} {}", answer.speed_unit.name());
            let (w0, half) = (point.w0_n_per_kn, HALF_95 * point.std);
            text += &format!("    {name:<24} {w0:>12.4} ± {half:.4} N/kN\n");
        }
    }
    if let Some(runs) = &answer.runs {
        text += &runs::report(runs, answer.speed_unit);
    }
    if !answer.not_run.is_empty() {
        text += &format!("\nnot run: {}; --all runs them too\n", answer.not_run.join(", "));
    }
    text + "\n± is the half width of the 95 % interval; a mass is that of the last run\n"
}

/// Returns a parameter's unit, with a space before it; empty for a ratio.
fn unit_of(name: &str) -> String {
    let parameter = Parameter::ALL.iter().find(|it| it.name() == name);
    match schema::unit_of(parameter.map_or(name, |it| it.full_name())) {
        "" => String::new(),
        unit => format!(" {unit}"),
    }
}
