//! `dynocar identify`: the daemon's pipelines over recorded runs.

mod runs;

use std::path::PathBuf;

use clap::Args;
use dynocar_analysis::dataset::{Dataset, DatasetDiagnostic, DatasetHead, Run};
use dynocar_analysis::identify::{
    self, Identification, default_estimators, recommended_estimators,
};
use dynocar_analysis::parallel;
use dynocar_core::plausibility::Severity;
use dynocar_estimators::EstimatorSettings;
use dynocar_model::train::PowerTrain;
use dynocar_model::units::Unit;
use dynocar_shared::{HALF_95, Parameter, ParameterSnapshot, PipelineKind, schema};
use serde::Serialize;

use self::runs::{EstimatorAnswer, EstimatorSpread, RunAnswer};
use crate::dataset::{self, FilesOfDataset};
use crate::run_facts::diagnostics;
use dynocar::cli::Failure;
use dynocar::dataset::{LoadError, SourceArguments};
use dynocar::output::{give, require_files};

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
    let (files, head) = dataset::open(question.source.source())?;
    let recommended = |has_pressure| recommended_estimators(&head.train, has_pressure);
    let is_chosen = named.is_some();
    let mut estimators = named.unwrap_or_else(|| recommended(true));
    let learned = Learned::from_runs(&files, &head, &estimators, question)?;
    if !is_chosen {
        estimators = recommended(learned.has_pressure);
    }
    let speed_unit = head.manifest.speed_unit();
    let answers = |of: &[Snapshot]| -> Vec<EstimatorAnswer> {
        let permitted =
            of.iter().filter(|(kind, _)| estimators.iter().any(|it| it.kind() == *kind));
        permitted.map(|(kind, it)| EstimatorAnswer::new(*kind, it, speed_unit)).collect()
    };
    let dataset = learned.dataset;
    let mut runs = question.per_run.then(|| {
        let alone = dataset.runs.iter().zip(&learned.by_run);
        alone.map(|(run, of)| RunAnswer::new(run, answers(of))).collect::<Vec<_>>()
    });
    let mut learned = answers(&learned.from_all);
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
        dataset: dataset.name,
        speed_unit,
        diagnostics,
        estimators: learned,
        not_run: if is_chosen { Vec::new() } else { others(&estimators) },
        between_runs: runs.as_deref().map(runs::spreads),
        runs,
    })
}

/// An estimator's kind with its last estimate.
type Snapshot = (PipelineKind, ParameterSnapshot);

/// Estimates from the runs of a dataset.
struct Learned {
    /// The dataset, without the samples of its runs.
    dataset: Dataset,
    /// From all runs, one after the other.
    from_all: Vec<Snapshot>,
    /// From each run alone, where that was asked for.
    by_run: Vec<Vec<Snapshot>>,
    has_pressure: bool,
}

impl Learned {
    /// Learns from the runs one after the other, of which only as many are in memory as there are threads.
    fn from_runs(
        files: &FilesOfDataset,
        head: &DatasetHead,
        estimators: &[EstimatorSettings],
        question: &Question,
    ) -> Result<Self, Failure> {
        let begin = || {
            let new = |it| Identification::new(&head.train, &head.track, it);
            let all: Result<Vec<_>, _> = estimators.iter().map(new).collect();
            all.map_err(|error| Failure::Input(format!("{error}")))
        };
        let of = |all: &[Identification]| -> Vec<Snapshot> {
            let estimates = all.iter().map(Identification::estimate);
            estimators.iter().map(EstimatorSettings::kind).zip(estimates).collect()
        };
        let mut dataset = head.without_runs();
        let (mut all, mut by_run, mut has_pressure) = (begin()?, Vec::new(), false);
        let indices: Vec<usize> = (0..head.manifest.runs.len()).collect();
        for indices in indices.chunks(parallel::threads()) {
            let read = parallel::of_each(indices, |&index| {
                let mut run = head.read_run(files, index).map_err(LoadError::from)?;
                if question.traction_only {
                    run.keep_traction_only();
                }
                Ok(run)
            });
            let mut runs = read.into_iter().collect::<Result<Vec<Run>, LoadError>>()?;
            all = parallel::of_each_owned(all, |_, mut identification| {
                runs.iter().for_each(|run| identification.update_with_run(run));
                identification
            });
            if question.per_run {
                let alone = parallel::of_each(&runs, |run| {
                    let mut own = begin()?;
                    own.iter_mut().for_each(|it| it.update_with_run(run));
                    Ok(of(&own))
                });
                by_run.extend(alone.into_iter().collect::<Result<Vec<_>, Failure>>()?);
            }
            has_pressure |= runs.iter().any(identify::has_pressure);
            runs.iter_mut().for_each(|run| drop(run.split_off_samples()));
            dataset.runs.append(&mut runs);
        }
        Ok(Learned { dataset, from_all: of(&all), by_run, has_pressure })
    }
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
