//! `explain`: the answer, the report with its plots, what the updated model predicts, and its files.

use std::path::PathBuf;

use dynocar::cli::Failure;
use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::score::PredictedRun;
use dynocar_workshop::cli::explain as command;
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
    path: PathBuf,
    traction_only: bool,
    dataset: Dataset,
    explanation: Explanation,
}

/// Explains the dataset at a path.
#[pyfunction]
pub(crate) fn explain(
    py: Python<'_>,
    path: PathBuf,
    traction_only: bool,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Explained> {
    let of = path.clone();
    let explained = in_background(py, progress.as_ref(), move |progress| {
        command::answer(&of, traction_only, progress)
    })?;
    let (dataset, explanation) = explained.map_err(|failure| of_failure(py, &failure))?;
    Ok(Explained { path, traction_only, dataset, explanation })
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
        let mut arguments = vec!["explain".to_owned(), self.path.display().to_string()];
        arguments.extend(self.traction_only.then(|| "--traction-only".to_owned()));
        arguments.extend(["--report", "report.html"].map(str::to_owned));
        let page = py.detach(|| {
            let command = command_line(arguments);
            command::page(&self.path, &self.dataset, &self.explanation, command)
        });
        page.map_err(|failure| of_failure(py, &failure))
    }

    /// Names and SVG of the report's plots.
    fn plots(&self, py: Python<'_>) -> PyResult<Vec<(String, String)>> {
        let drawn = py.detach(|| images(&self.dataset, &self.explanation));
        drawn.map_err(|error| of_failure(py, &Failure::work(error)))
    }

    /// Speeds that the updated model predicts, by run.
    fn predictions(&self) -> PyResult<Vec<(String, Table)>> {
        let table = |run: &PredictedRun| -> PyResult<(String, Table)> {
            let columns = [("time_s", &run.time_s), ("speed_mps", &run.speed_mps)];
            let columns = columns.map(|(name, values)| (name.to_owned(), values.clone())).to_vec();
            Ok((run.file.clone(), Table::of(columns)?))
        };
        self.explanation.predictions.iter().map(table).collect()
    }

    /// Writes the updated model into a folder; gives the files, and the kinds that they cannot express.
    fn write_grown(
        &self,
        py: Python<'_>,
        folder: PathBuf,
    ) -> PyResult<(Vec<PathBuf>, Vec<String>)> {
        let written = py.detach(|| command::grow(&folder, &self.path, &self.explanation));
        let grown = written.map_err(|failure| of_failure(py, &failure))?;
        Ok((grown.files, grown.not_expressed))
    }
}
