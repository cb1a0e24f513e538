//! `explain`: the answer, the report with its plots, what the updated model predicts, and its files.

use std::path::PathBuf;

use dynocar::cli::Failure;
use dynocar::dataset::DatasetSource;
use dynocar_analysis::dataset::Role;
use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::score::predicted;
use dynocar_model::simulate::Restart;
use dynocar_shared::TrainId;
use dynocar_workshop::cli::explain as command;
use dynocar_workshop::cli::explained_runs::ExplainedRuns;
use dynocar_workshop::report::images::images;
use dynocar_workshop::report::provenance::command_line;
use pyo3::prelude::*;

use crate::background::in_background;
use crate::errors::of_failure;
use crate::recorded::json;
use crate::table::Table;

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

    /// The report, one page of HTML.
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

    /// Speeds that the updated model predicts, by run.
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
