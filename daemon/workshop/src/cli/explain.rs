//! `dynocar explain`: the undeclared effect that explains the residual of the declared model. For people: a verdict of at
//! most two sentences, then for each effect its place, size, share of the error and recommended action.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use dynocar::cli::Failure;
use dynocar::cli::text::{WIDTH, wrap};
use dynocar::dataset::{DatasetSource, SourceArguments};
use dynocar::output::{
    OutputError, give, report_line, require_files, require_folder, require_new,
    require_replaceable, write_file, write_in_folder,
};
use dynocar_analysis::dataset::{Dataset, Role};
use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::answer::{Considered, EffectAnswer, ExplainAnswer};
use dynocar_analysis::explain::report::effect as effect_words;
use dynocar_analysis::explain::report::timeline::Timeline;
use dynocar_analysis::explain::score::predicted;
use dynocar_analysis::explain::selection::Progress;
use dynocar_analysis::explain::stop_to_stop::Metric;
use dynocar_model::simulate::Restart;
use dynocar_model::words;
use dynocar_shared::HALF_95;
use indicatif::{ProgressBar, ProgressStyle};

use super::explained_runs::ExplainedRuns;
use super::threads::Threads;
use crate::dataset::annotate;
use crate::report;
use crate::report::provenance::{Provenance, for_shell, own_command_line};
use crate::run_facts::diagnostics;
use crate::updated::{UPDATED_FILES, UPDATED_MARK, UpdatedFiles, UpdatedModelError, write_updated};

/// First line of a file with predictions.
const PREDICTIONS_HEADER: &str = "time_s,speed_mps\n";
/// Why nothing is grown from data that cannot be true.
const IMPOSSIBLE: &str = "no updated model is written: the data cannot be true";

/// Find which effect the model lacks, add it, and report the error before and after.
#[derive(Debug, Args)]
pub struct ExplainArguments {
    #[command(flatten)]
    source: SourceArguments,
    /// Use the forces under traction only: for recordings without the friction brake's force
    #[arg(long)]
    traction_only: bool,
    /// Write the answer for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
    /// Write the speeds that the model with the effect predicts for the holdout runs
    #[arg(long, value_name = "DIR")]
    predictions: Option<PathBuf>,
    /// Write the updated model, and a dataset of it and the runs, into this folder
    #[arg(long, value_name = "DIR")]
    grown: Option<PathBuf>,
    /// Write a report for people: one HTML page that needs nothing else
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Write a recording with verdict, effects, residual and predicted speeds in addition to the data
    #[arg(long, value_name = "FILE.mcap")]
    annotate: Option<PathBuf>,
    /// Write the report's plots as SVG files into this folder
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
}

/// Explains a dataset and prints the answer.
///
/// # Errors
///
/// A wrong dataset or name of a result is an input failure.
pub fn execute(arguments: &ExplainArguments) -> Result<(), Failure> {
    require_names(arguments)?;
    let source = arguments.source.source();
    let mut runs = ExplainedRuns::at(source, arguments.traction_only)?;
    if let Some(folder) = &arguments.predictions {
        for name in prediction_names(&runs.dataset).values() {
            require_replaceable(&folder.join(name), PREDICTIONS_HEADER)?;
        }
    }
    let bar = progress_bar();
    let progress = |share: f64, what: &str| {
        // Looking again at an earlier choice is no step back.
        bar.set_position(bar.position().max((1000.0 * share) as u64));
        bar.set_message(what.replace('_', " "));
    };
    let explained = arguments.threads.work(|| runs.explain(&progress))?;
    bar.finish_and_clear();
    let mut explanation = explained?;
    if let Some(folder) = &arguments.predictions {
        explanation.answer.predictions = write_predictions(folder, &runs, &explanation)?;
    }
    let dataset = runs.dataset;
    if let Some(folder) = &arguments.grown {
        if explanation.answer.impossibilities().next().is_none() {
            report_updated(&grow(folder, source, &explanation)?);
            let again = if arguments.traction_only { " --traction-only" } else { "" };
            let folder = for_shell(&folder.display().to_string());
            report_line(&format!("what is left with it: dynocar explain {folder}{again}"));
        } else {
            report_line(IMPOSSIBLE);
        }
    }
    if let Some(file) = &arguments.report {
        let page = page(source, &dataset, &explanation, own_command_line())?;
        write_file(file, &page)?;
        report_line(&format!("report: {}", file.display()));
    }
    if let Some(folder) = &arguments.plots {
        write_plots(folder, &dataset, &explanation)?;
    }
    if let Some(file) = &arguments.annotate {
        let timeline = Timeline::new(&dataset, &explanation);
        annotate(source, &timeline, file)?;
    }
    Ok(give(arguments.json.as_deref(), &explanation.answer, || text(&explanation.answer))?)
}

/// Explains the dataset at a path; `progress` is given how far that is, and may unwind to end it.
///
/// # Errors
///
/// A wrong dataset is an input failure.
pub fn answer(
    source: DatasetSource,
    traction_only: bool,
    progress: Progress,
) -> Result<(ExplainedRuns, Explanation), Failure> {
    let mut runs = ExplainedRuns::at(source, traction_only)?;
    let explanation = runs.explain(progress)?;
    Ok((runs, explanation))
}

/// Refuses wrong names of results before the work begins.
fn require_names(arguments: &ExplainArguments) -> Result<(), Failure> {
    require_files(&[(&arguments.json, "{"), (&arguments.report, report::PAGE_MARK)])?;
    for folder in [&arguments.plots, &arguments.predictions] {
        folder.as_deref().map_or(Ok(()), require_folder)?;
    }
    arguments.grown.as_deref().map_or(Ok(()), require_growable)?;
    arguments.annotate.as_deref().map_or(Ok(()), require_new)?;
    match (&arguments.json, &arguments.report) {
        (Some(json), Some(report)) if json == report => Err(Failure::Output(OutputError::Name {
            path: report.clone(),
            problem: "expected another file for --report than for --json",
        })),
        _ => Ok(()),
    }
}

/// Writes the updated model of the dataset at a path into a folder.
///
/// # Errors
///
/// When the data cannot be true, or a file cannot be written or would take the place of another.
pub fn grow(
    folder: &Path,
    source: DatasetSource,
    explanation: &Explanation,
) -> Result<UpdatedFiles, Failure> {
    require_growable(folder)?;
    if explanation.answer.impossibilities().next().is_some() {
        return Err(Failure::Work(IMPOSSIBLE.into()));
    }
    write_updated(source, explanation, folder).map_err(|error| match error {
        UpdatedModelError::Output(error) => error.into(),
        error => Failure::work(error),
    })
}

/// Refuses a folder in which the files of an updated model would take the place of others.
fn require_growable(folder: &Path) -> Result<(), OutputError> {
    require_folder(folder)?;
    UPDATED_FILES.iter().try_for_each(|name| require_replaceable(&folder.join(name), UPDATED_MARK))
}

fn report_updated(grown: &UpdatedFiles) {
    for file in &grown.files {
        report_line(&format!("updated model: {}", file.display()));
    }
    if !grown.not_expressed.is_empty() {
        let kinds = grown.not_expressed.join(", ");
        report_line(&format!("the files cannot express {kinds}: use the answer of --json for it"));
    }
}

/// Returns a bar on standard error while that is a terminal; nothing otherwise.
fn progress_bar() -> ProgressBar {
    let bar = ProgressBar::new(1000);
    let template = "{bar:40} {percent:>3} %  {elapsed:>3}  {msg}";
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Returns the report on an explanation of the dataset at a path; `command` makes the same one.
///
/// # Errors
///
/// When a file of the dataset cannot be read any more, or a plot cannot be drawn.
pub fn page(
    source: DatasetSource,
    dataset: &Dataset,
    explanation: &Explanation,
    command: String,
) -> Result<String, Failure> {
    let provenance = Provenance::new(source, command)?;
    report::page(dataset, explanation, &provenance).map_err(Failure::work)
}

fn write_plots(folder: &Path, dataset: &Dataset, explanation: &Explanation) -> Result<(), Failure> {
    let images = report::page::images(dataset, explanation).map_err(Failure::work)?;
    for (name, svg) in images {
        let path = write_in_folder(folder, &name, &svg)?;
        report_line(&format!("plot: {}", path.display()));
    }
    Ok(())
}

/// Names of the files with predictions by the holdout run's file: the same name, with its folders
/// where several runs would share it.
fn prediction_names(dataset: &Dataset) -> BTreeMap<String, String> {
    let last = |file: &str| file.rsplit('/').next().unwrap_or(file).to_string();
    let holdout: Vec<&str> = dataset.with_role(Role::Holdout).map(|run| &run.file[..]).collect();
    let name = |file: &str| match holdout.iter().filter(|it| last(it) == last(file)).count() {
        1 => last(file),
        _ => file.replace('/', "_"),
    };
    holdout.iter().map(|file| ((*file).into(), name(file))).collect()
}

/// Writes one file for each holdout run; gives the files by run.
fn write_predictions(
    folder: &Path,
    runs: &ExplainedRuns,
    explanation: &Explanation,
) -> Result<BTreeMap<String, String>, Failure> {
    let names = prediction_names(&runs.dataset);
    let mut files = BTreeMap::new();
    for (index, run) in runs.dataset.runs.iter().enumerate() {
        let Some(name) = names.get(&run.file) else { continue };
        let run = runs.prepared(index, explanation)?;
        let prediction = predicted(&explanation.outcome.fit, &run, Restart::FullRun);
        let mut text = String::from(PREDICTIONS_HEADER);
        for (time_s, speed_mps) in run.recording.time_s().iter().zip(prediction.speed_mps()) {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{:.3},{speed_mps:.4}", run.offset_s + time_s);
        }
        let path = write_in_folder(folder, name, &text)?;
        files.insert(run.file.clone(), path.display().to_string());
    }
    Ok(files)
}

/// Columns of a row before its words.
const INDENT: usize = 12;

/// Returns the answer for people.
pub fn text(answer: &ExplainAnswer) -> String {
    let mut text = diagnostics(&answer.diagnostics)
        + &plain(&[&answer.words.heading, &answer.words.left].map(String::as_str).concat());
    for effect in &answer.effects {
        text += "\n";
        text += &found(effect);
    }
    text += "\n";
    text += &limits(answer);
    if answer.impossibilities().next().is_some() {
        return text;
    }
    text += "\n";
    text += &figures(answer);
    text + &others(answer)
}

/// Describes the other explanations, with the evidence against them; those that are no more than chance are
/// counted.
fn others(answer: &ExplainAnswer) -> String {
    let is_chance = |it: &&Considered| it.evidence.is_some_and(|evidence| evidence <= 0.0);
    let chance = answer.considered.iter().filter(is_chance).count();
    let mut text = String::from("\nevidence  not accepted\n");
    for considered in answer.considered.iter().filter(|it| !is_chance(it)) {
        let evidence = considered.evidence.map_or("-".into(), |evidence| format!("{evidence:.0}"));
        text += &format!("{evidence:>8}  {:20} {}\n", considered.kind, considered.reason);
    }
    if chance > 0 {
        text += &format!("  0 or less  {chance} other kinds: they explain no more than chance\n");
    }
    text
}

/// Returns an effect, a row for each question.
fn found(effect: &EffectAnswer) -> String {
    let mut rows = row("what", &format!("{} ({})", words::kind_name(effect.kind), effect.kind));
    rows += &row("where", &effect_words::place(effect));
    for size in effect_words::sizes(&effect.parameters, &effect.std) {
        rows += &row("size", &size);
    }
    let percent = 100.0 * effect.error_reduction;
    rows += &row(
        "removes",
        &match percent {
            0.5.. => format!("{percent:.0} % of the open-loop error of the fit runs"),
            _ => "none of the open-loop error, which each run's own load and wind make".into(),
        },
    );
    let means = effect_words::meaning(&effect.meaning);
    if !means.is_empty() {
        rows += &row("means", &means);
    }
    for other in &effect.runners_up {
        rows += &row("or else", &other.in_words());
    }
    rows += &row("sure", &effect_words::sureness(effect.p_value));
    if let Some(to_do) = effect_words::to_do(effect) {
        rows += &row("to do", to_do);
    }
    rows
}

/// Describes the alternatives that explain the runs, the limits of the answer, and the runs that would settle it.
fn limits(answer: &ExplainAnswer) -> String {
    let others: Vec<String> =
        answer.ambiguous_with.iter().map(|kind| words::kind_name(kind).into()).collect();
    let others = (!others.is_empty()).then(|| row("or else", &words::joined(&others)));
    let caveats = answer.caveats.iter().map(|caveat| row("note", caveat));
    let experiment = answer.experiment.iter().map(|experiment| row("next", experiment));
    let unscored = answer.unscored.iter().map(|unscored| row("note", unscored));
    others.into_iter().chain(caveats).chain(experiment).chain(unscored).collect()
}

/// Returns the coefficients and errors.
fn figures(answer: &ExplainAnswer) -> String {
    let (base, std) = (&answer.base, &answer.base.std);
    let [a, b, c] = [std.a, std.b, std.c].map(|deviation| HALF_95 * deviation);
    let mut text = format!(
        "refitted: a = {:.3} ± {a:.3} N/kN, b = {:.4} ± {b:.4}, c = {:.6} ± {c:.6} (95 %, v in m/s)\n",
        base.a, base.b, base.c
    );
    if let Some(judged) = answer.judged.filter(|it| it.metric == Metric::StopToStop) {
        let [before, after] = judged.error_mps;
        let predicted = judged.predicted();
        text += &format!("holdout runs{predicted}: {before:.3} m/s before, {after:.3} m/s after\n");
    }
    if let (Some(before), Some(after)) = (answer.rmse_before, answer.rmse_after) {
        text += &format!("holdout runs, open loop: {before:.3} m/s before, {after:.3} m/s after\n");
    }
    text
}

/// Returns a label and its words, in lines below each other.
fn row(label: &str, words: &str) -> String {
    let lines = wrap(words, WIDTH - INDENT);
    let next = format!("\n{:INDENT$}", "");
    format!("  {label:<width$}{}\n", lines.join(&next), width = INDENT - 2)
}

fn plain(words: &str) -> String {
    format!("{}\n", wrap(words, WIDTH).join("\n"))
}
