//! `dynocar check` of a daemon's configuration; the workshop checks all other files.

mod daemon;

use std::path::{Path, PathBuf};

use clap::Args;
use dynocar_dataset::{DatasetDiagnostic, top_keys};
use serde::Serialize;

use super::Failure;
use super::companion::{become_it, words_of_command};
use crate::config::DaemonConfig;
use crate::dataset::{FileKind, kind_of, labelled_text};
use crate::output::{give, report_line, require_file, write_json};
use crate::programs::{ErrorAnswer, WORKSHOP};

pub use daemon::{DaemonAnswer, answer, read, report};

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
    let config = or_refused(path, json, read(path))?;
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
        diagnostics: Vec::new(),
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
