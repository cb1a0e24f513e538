//! `check`, `read` and `identify` over recorded runs: the answers of the commands, as JSON and in words.

use std::path::{Path, PathBuf};

use dynocar::cli::Failure;
use dynocar::cli::check::refusal;
use dynocar::dataset::{DatasetSource, SourceArguments};
use dynocar::output::OutputError;
use dynocar_shared::TrainId;
use dynocar_workshop::cli::check as checking;
use dynocar_workshop::cli::identify as identifying;
use pyo3::prelude::*;
use serde::Serialize;

use crate::background::in_background;
use crate::errors::of_failure;
use crate::table::Table;

/// An answer as JSON and in words.
pub(crate) type JsonAndText = (String, String);

/// An answer for machines, as the command line gives it.
pub(crate) fn json(answer: &impl Serialize) -> Result<String, Failure> {
    serde_json::to_string(answer).map_err(|error| Failure::Output(OutputError::Json(error)))
}

/// A path and the train that is meant.
fn of(path: &Path, train: Option<u64>) -> DatasetSource<'_> {
    DatasetSource { path, train: train.map(TrainId) }
}

/// Returns the description of a path; its errors are part of the answer.
#[pyfunction]
pub(crate) fn check(py: Python<'_>, path: PathBuf, train: Option<u64>) -> PyResult<JsonAndText> {
    let answer = in_background(py, None, move |_| {
        match checking::understand(of(&path, train), checking::SamplesOfRuns::Dropped) {
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

/// A dataset: what `check` says of it, and the tables of its runs and of all of them.
#[pyfunction]
pub(crate) fn read(
    py: Python<'_>,
    path: PathBuf,
    train: Option<u64>,
) -> PyResult<(JsonAndText, Vec<Table>, Table)> {
    let read = in_background(py, None, move |_| {
        let understood = checking::understand(of(&path, train), checking::SamplesOfRuns::Kept)?;
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
