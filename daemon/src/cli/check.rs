//! `dynocar check` of a daemon's configuration: its trains, estimators and threads in words. The workshop checks all
//! other files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use dynocar_dataset::{DatasetDiagnostic, top_keys};
use dynocar_shared::Quantity;
use serde::Serialize;

use super::Failure;
use super::failure::{become_it, words_of_command};
use super::text::{TextTable, line, short};
use crate::config::{DaemonConfig, TrainConfig};
use crate::dataset::{FileKind, kind_of, labelled_text};
use crate::output::{give, report_line, require_file, write_json};
use crate::programs::{ErrorAnswer, WORKSHOP};
use crate::shadow::rule::Adopt;

/// Check a dataset, train, track or configuration, and report its content.
#[derive(Clone, Debug, Args)]
pub struct CheckArguments {
    /// A dataset's folder or its dataset.toml, a recording, a train.toml, a track.toml or a daemon.toml.
    pub path: PathBuf,
    /// Only this train of a recording that holds several.
    #[arg(long, value_name = "ID")]
    pub train: Option<u64>,
    /// Also write the result as JSON; '-' for standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Also draw the line's profile and the train's effort curves as SVG into this folder.
    #[arg(long, value_name = "FOLDER")]
    pub draw: Option<PathBuf>,
}

/// The answer of `dynocar check --json`, for every kind of file.
#[derive(Debug, Serialize)]
pub struct CheckAnswer<C> {
    /// Checked path.
    pub path: String,
    /// Kind of the file; `null` when nothing could be understood.
    pub kind: Option<FileKind>,
    /// True without errors.
    pub valid: bool,
    /// Errors.
    pub errors: Vec<String>,
    /// The first of them, as every command gives it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<ErrorAnswer>,
    /// Diagnostics that may spoil results, the worst first.
    #[serde(rename = "notes")]
    pub diagnostics: Vec<DatasetDiagnostic>,
    /// Contents as understood.
    #[serde(flatten)]
    pub content: Option<C>,
}

/// Contents of a daemon's configuration.
#[derive(Debug, Serialize)]
struct Content<'a> {
    daemon: DaemonAnswer<'a>,
}

/// Checks a daemon's configuration, or becomes the workshop, which checks everything else.
///
/// # Errors
///
/// When the file is wrong, or there is no workshop.
pub fn execute(arguments: &CheckArguments) -> Result<(), Failure> {
    let (path, json) = (&arguments.path, arguments.json.as_deref());
    if let Some(file) = json {
        require_file(file, "{")?;
    }
    let is_ours = or_refused(path, json, may_be_configuration(path))?;
    if !is_ours || arguments.draw.is_some() {
        return become_it(WORKSHOP, Some("check"), &words_of_command());
    }
    let config = or_refused(path, json, DaemonConfig::load(path).map_err(Failure::from))?;
    give(json, &understood(path, &config), || report(&config))?;
    Ok(())
}

/// Returns the answer for machines where nothing could be understood.
pub fn refusal(path: &Path, error: ErrorAnswer) -> CheckAnswer<()> {
    CheckAnswer {
        path: path.display().to_string(),
        kind: None,
        valid: false,
        errors: vec![error.message.clone()],
        error: Some(error),
        diagnostics: Vec::new(),
        content: None,
    }
}

/// Returns a result, or its failure once machines know it.
///
/// # Errors
///
/// That failure.
pub fn or_refused<T>(
    path: &Path,
    json: Option<&Path>,
    result: Result<T, Failure>,
) -> Result<T, Failure> {
    if let Err(failure) = &result
        && let (Some(file), Some(error)) = (json, failure.answer())
        // The exit status is that of the input's error.
        && let Err(error) = write_json(file, &refusal(path, error))
    {
        report_line(&format!("dynocar: {error}"));
    }
    result
}

fn understood<'a>(path: &Path, config: &'a DaemonConfig) -> CheckAnswer<Content<'a>> {
    CheckAnswer {
        path: path.display().to_string(),
        kind: Some(FileKind::Daemon),
        valid: true,
        errors: Vec::new(),
        error: None,
        diagnostics: config.diagnostics().into_iter().map(|(_, diagnostic)| diagnostic).collect(),
        content: Some(Content { daemon: answer(config) }),
    }
}

/// Returns true for a configuration, by its tables; a TOML file that cannot be read is refused here.
fn may_be_configuration(path: &Path) -> Result<bool, Failure> {
    let is_toml = path.extension().is_some_and(|extension| extension == "toml");
    if !is_toml || !path.is_file() {
        return Ok(false);
    }
    let (label, text) = labelled_text(path)?;
    Ok(kind_of(&top_keys(&label, &text)?) == Some(FileKind::Daemon))
}

/// Returns the configuration in words and columns.
pub fn report(config: &DaemonConfig) -> String {
    let mut text = String::from("daemon\n");
    let root = config.process.root.as_ref().map(|root| root.display().to_string());
    text += &line("root", root.as_deref().unwrap_or("DYNOCAR_ROOT, else /tmp/dynocar-<user>"));
    text += &line(
        "adaptive",
        &format!("looks for samples for {} µs, then sleeps", config.process.spin_us),
    );
    text += &line("heartbeat", &format!("every {} ms", config.process.heartbeat_ms));
    let memory = if config.process.lock_memory { "locked" } else { "may be paged" };
    text += &line("memory", memory);
    if let Some(models) = &config.models {
        let rule = &models.rule;
        let by = match rule.adopt {
            Adopt::Ask => "adopted by hand",
            Adopt::WhenBetter => "adopted by the rule",
        };
        let gain = short(100.0 * rule.least_gain, 3);
        let trips = short(rule.trips_between_mistakes, 6);
        text += &line("models", &models.directory.display().to_string());
        text += &line(
            "",
            &format!(
                "{by} where {gain} % of the error or more are gained; at most one mistake in {trips} trips"
            ),
        );
    }

    let mut trains = TextTable::new(&["train", "name", "mass t", "line"], &[1, 3]);
    for train in &config.trains {
        let track = train.track.as_ref().map_or("not known", |track| &track.name);
        let mass_t = short(train.model.mass_kg / 1000.0, 3);
        trains.push(vec![train.id.to_string(), train.model.name.clone(), mass_t, track.into()]);
    }
    let mut pipelines = TextTable::new(
        &["pipeline", "name", "kind", "thread", "core", "idle", "priority", "trains"],
        &[1, 2, 3, 5, 6, 7],
    );
    for (index, pipeline) in config.pipelines.iter().enumerate() {
        let thread = &config.threads[pipeline.thread];
        let trains: Vec<_> = pipeline.trains.iter().map(ToString::to_string).collect();
        pipelines.push(vec![
            index.to_string(),
            pipeline.name.clone(),
            pipeline.estimator.kind().to_string(),
            thread.name.clone(),
            thread.core.map_or("any".into(), |core| core.to_string()),
            thread.idle.name().into(),
            thread.priority.map_or("ordinary".into(), |priority| format!("fifo {priority}")),
            trains.join(" "),
        ]);
    }
    let mut answers = TextTable::new(&["quantity", "answered for train", "by"], &[1, 2]);
    for train in &config.trains {
        for (quantity, name) in answers_of(config, train) {
            answers.push(vec![quantity.into(), train.id.to_string(), name.into()]);
        }
    }
    let notes: String = config
        .diagnostics()
        .iter()
        .map(|(train, diagnostic)| format!("train {train}: {}\n", diagnostic.labelled()))
        .collect();
    let notes = if notes.is_empty() { notes } else { format!("\nnotes\n{notes}") };
    format!("{text}\n{trains}\n{pipelines}\n{answers}{notes}")
}

/// Returns each quantity that a train's controller may ask for, with the pipeline that answers.
fn answers_of<'a>(
    config: &'a DaemonConfig,
    train: &'a TrainConfig,
) -> impl Iterator<Item = (&'static str, &'a str)> {
    Quantity::ALL.iter().filter_map(|&quantity| {
        let pipeline_index = train.answers.pipeline_index(quantity)?;
        Some((quantity.name(), config.pipelines[pipeline_index].name.as_str()))
    })
}

/// A daemon configuration, machine-readable.
#[derive(Debug, Serialize)]
pub struct DaemonAnswer<'a> {
    trains: Vec<DaemonTrainAnswer<'a>>,
    pipelines: Vec<PipelineAnswer<'a>>,
}

#[derive(Debug, Serialize)]
struct DaemonTrainAnswer<'a> {
    id: u64,
    name: &'a str,
    track: Option<&'a str>,
    answers: BTreeMap<&'static str, &'a str>,
}

#[derive(Debug, Serialize)]
struct PipelineAnswer<'a> {
    name: &'a str,
    kind: &'static str,
    thread: &'a str,
    core: Option<usize>,
    idle: &'static str,
    priority: Option<u8>,
    trains: Vec<u64>,
}

/// Returns the machine-readable form of a configuration.
pub fn answer(config: &DaemonConfig) -> DaemonAnswer<'_> {
    DaemonAnswer {
        trains: config
            .trains
            .iter()
            .map(|train| DaemonTrainAnswer {
                id: train.id.0,
                name: &train.model.name,
                track: train.track.as_ref().map(|track| track.name.as_str()),
                answers: answers_of(config, train).collect(),
            })
            .collect(),
        pipelines: config
            .pipelines
            .iter()
            .map(|pipeline| {
                let thread = &config.threads[pipeline.thread];
                PipelineAnswer {
                    name: &pipeline.name,
                    kind: pipeline.estimator.kind().name(),
                    thread: &thread.name,
                    core: thread.core,
                    idle: thread.idle.name(),
                    priority: thread.priority,
                    trains: pipeline.trains.iter().map(|train| train.0).collect(),
                }
            })
            .collect(),
    }
}
