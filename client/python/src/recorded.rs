//! `check`, `read`, `identify` and `explain` over recorded runs: the answers of the commands as JSON and in words, the report
//! of an explanation with its plots, the predictions of the updated model, and its files.

use std::path::{Path, PathBuf};

use dynocar::cli::Failure;
use dynocar::cli::check::refusal;
use dynocar::dataset::{DatasetSource, SourceArguments};
use dynocar::output::OutputError;
use dynocar_analysis::dataset::Role;
use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::score::predicted;
use dynocar_model::simulate::Restart;
use dynocar_shared::TrainId;
use dynocar_workshop::cli::explained_runs::ExplainedRuns;
use dynocar_workshop::cli::{check as checking, explain as command, identify as identifying};
use dynocar_workshop::report::images::images;
use dynocar_workshop::report::provenance::command_line;
use pyo3::prelude::*;
use serde::Serialize;

use crate::calls::{in_background, of_failure};
use crate::table::Table;

/// An answer as JSON and in words.
pub(crate) type JsonAndText = (String, String);

/// Returns an answer for machines, as the command line gives it.
pub(crate) fn json(answer: &impl Serialize) -> Result<String, Failure> {
    serde_json::to_string(answer).map_err(|error| Failure::Output(OutputError::Json(error)))
}

/// Returns a path and the train that is meant.
fn source(path: &Path, train: Option<u64>) -> DatasetSource<'_> {
    DatasetSource { path, train: train.map(TrainId) }
}

/// Returns the description of a path; its errors are part of the answer.
#[pyfunction]
pub(crate) fn check(py: Python<'_>, path: PathBuf, train: Option<u64>) -> PyResult<JsonAndText> {
    let answer = in_background(py, None, move |_| {
        match checking::understand(source(&path, train), checking::SamplesOfRuns::Dropped) {
            Ok(understood) => Ok((json(&understood.answer(&path))?, understood.text())),
            Err(failure) => match failure.answer() {
                Some(error) => {
                    let words = error.message.clone();
                    Ok((json(&refusal(&path, error))?, words))
                }
                None => Err(failure),
            },
        }
    })?;
    answer.map_err(|failure: Failure| of_failure(py, &failure))
}

/// Returns a dataset: the answer of `check`, and the tables of its runs and of all of them.
#[pyfunction]
pub(crate) fn read(
    py: Python<'_>,
    path: PathBuf,
    train: Option<u64>,
) -> PyResult<(JsonAndText, Vec<Table>, Table)> {
    let read = in_background(py, None, move |_| {
        let understood = checking::understand(source(&path, train), checking::SamplesOfRuns::Kept)?;
        let wrong: Option<Failure> = understood.errors().next().map(|it| it.clone().into());
        let answer = (json(&understood.answer(&path))?, understood.text());
        match (understood, wrong) {
            (_, Some(failure)) => Err(failure),
            (checking::Understood { dataset: Some((_, runs)), .. }, None) => {
                Ok((answer, runs.into_iter().flatten().collect::<Vec<_>>()))
            }
            _ => {
                let words = "expected a dataset's folder or its dataset.toml";
                Err(Failure::Input(format!("{}: {words}", path.display())))
            }
        }
    })?;
    let (answer, runs) = read.map_err(|failure| of_failure(py, &failure))?;
    let (each, all) = Table::of_runs(&runs)?;
    Ok((answer, each, all))
}

/// Returns the estimates of the daemon's pipelines from a dataset.
#[pyfunction]
pub(crate) fn identify(
    py: Python<'_>,
    path: PathBuf,
    train: Option<u64>,
    names: Vec<String>,
    all: bool,
    per_run: bool,
    traction_only: bool,
) -> PyResult<JsonAndText> {
    let answer = in_background(py, None, move |_| {
        let (source, estimator) = (SourceArguments { dataset: path, train }, names);
        let question = identifying::Question { source, estimator, all, per_run, traction_only };
        let answer = identifying::answer(&question)?;
        Ok((json(&answer)?, identifying::text(&answer)))
    })?;
    answer.map_err(|failure: Failure| of_failure(py, &failure))
}

/// An explained dataset.
#[pyclass(frozen, module = "dynocar._native")]
pub(crate) struct Explained {
    traction_only: bool,
    runs: ExplainedRuns,
    explanation: Explanation,
}

/// Explains the dataset at a path.
#[pyfunction]
pub(crate) fn explain(
    py: Python<'_>,
    path: PathBuf,
    train: Option<u64>,
    traction_only: bool,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Explained> {
    let explained = in_background(py, progress.as_ref(), move |progress| {
        let source = DatasetSource { path: &path, train: train.map(TrainId) };
        command::answer(source, traction_only, progress)
    })?;
    let (runs, explanation) = explained.map_err(|failure| of_failure(py, &failure))?;
    Ok(Explained { traction_only, runs, explanation })
}

#[pymethods]
impl Explained {
    fn json(&self, py: Python<'_>) -> PyResult<String> {
        json(&self.explanation.answer).map_err(|failure| of_failure(py, &failure))
    }

    fn text(&self) -> String {
        command::text(&self.explanation.answer)
    }

    /// Returns the report, one page of HTML.
    fn page(&self, py: Python<'_>) -> PyResult<String> {
        let DatasetSource { path, train } = self.runs.source();
        let mut arguments = vec!["explain".to_owned(), path.display().to_string()];
        arguments.extend(train.iter().flat_map(|it| ["--train".to_owned(), it.0.to_string()]));
        arguments.extend(self.traction_only.then(|| "--traction-only".to_owned()));
        arguments.extend(["--report", "report.html"].map(str::to_owned));
        let page = py.detach(|| {
            let command = command_line(arguments);
            command::page(self.runs.source(), &self.runs.dataset, &self.explanation, command)
        });
        page.map_err(|failure| of_failure(py, &failure))
    }

    /// Names and SVG of the report's plots.
    fn plots(&self, py: Python<'_>) -> PyResult<Vec<(String, String)>> {
        let drawn = py.detach(|| images(&self.runs.dataset, &self.explanation));
        drawn.map_err(|error| of_failure(py, &Failure::work(error)))
    }

    /// Returns the speeds that the updated model predicts, by run.
    fn predictions(&self, py: Python<'_>) -> PyResult<Vec<(String, Table)>> {
        let runs = &self.runs.dataset.runs;
        let of_role = |role| (0..runs.len()).filter(move |index| runs[*index].role == role);
        let table = |index: usize| -> PyResult<(String, Table)> {
            let run = self.runs.prepared(index, &self.explanation);
            let run = run.map_err(|failure| of_failure(py, &failure))?;
            let prediction = predicted(&self.explanation.outcome.fit, &run, Restart::FullRun);
            let time_s = run.recording.time_s().iter().map(|time_s| run.offset_s + time_s);
            let columns = vec![
                ("time_s".to_owned(), time_s.collect()),
                ("speed_mps".to_owned(), prediction.speed_mps().to_vec()),
            ];
            Ok((run.file.clone(), Table::of(columns)?))
        };
        of_role(Role::Fit).chain(of_role(Role::Holdout)).map(table).collect()
    }

    /// Writes the updated model into a folder; gives the files, and the kinds that they cannot express.
    fn write_grown(
        &self,
        py: Python<'_>,
        folder: PathBuf,
    ) -> PyResult<(Vec<PathBuf>, Vec<String>)> {
        let written = py.detach(|| command::grow(&folder, self.runs.source(), &self.explanation));
        let grown = written.map_err(|failure| of_failure(py, &failure))?;
        Ok((grown.files, grown.not_expressed))
    }
}
