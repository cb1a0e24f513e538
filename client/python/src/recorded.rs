//! `check`, `read`, `identify` and `explain` over recorded runs: the answers of the commands as JSON and in words, the
//! report of an explanation with its plots, the predictions of the updated model, and its files. Columns for NumPy and
//! tables for Arrow share their memory: nothing is copied.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{Array, ArrayRef, Float64Array, RecordBatch, RecordBatchIterator, UInt32Array};
use arrow_buffer::{BooleanBuffer, NullBuffer, ScalarBuffer};
use dynocar::cli::Failure;
use dynocar::cli::check::refusal;
use dynocar::dataset::{DatasetSource, SourceArguments};
use dynocar::output::OutputError;
use dynocar_analysis::dataset::{EXTRAS, Quantity, Role, Run};
use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::score::predicted;
use dynocar_model::simulate::Restart;
use dynocar_shared::{SampleField, TrainId};
use dynocar_workshop::cli::explained_runs::ExplainedRuns;
use dynocar_workshop::cli::{check as checking, explain as command, identify as identifying};
use dynocar_workshop::report::page::images;
use dynocar_workshop::report::provenance::command_line;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyCapsule, PyDict, PyType};
use serde::Serialize;

use crate::calls::{in_background, of_failure};

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

/// Name of the column that distinguishes the runs of a dataset.
const RUN: &str = "run";

/// Named columns of one length, NaN where a value is missing.
pub(crate) type Columns = Vec<(String, Vec<f64>)>;
/// A batch in a pickle: the run's number, and the bytes of its columns.
type Kept<B> = (Option<u32>, Vec<(String, B)>);
/// The only argument from which a table is made again.
type KeptBatches<'py> = (Vec<Kept<Bound<'py, PyBytes>>>,);

/// A column of numbers, which NumPy takes by `numpy.asarray`.
#[pyclass(frozen, module = "dynocar._native")]
pub(crate) struct Column(ScalarBuffer<f64>);

#[pymethods]
impl Column {
    /// NumPy's array interface: where the numbers lie; they cannot be written.
    #[getter(__array_interface__)]
    fn array_interface<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let interface = PyDict::new(py);
        interface.set_item("version", 3)?;
        interface
            .set_item("typestr", if cfg!(target_endian = "little") { "<f8" } else { ">f8" })?;
        interface.set_item("shape", (self.0.len(),))?;
        interface.set_item("data", (self.0.as_ptr() as usize, true))?;
        Ok(interface)
    }
}

/// A table, which pandas, polars and pyarrow take by Arrow's C stream interface.
#[pyclass(frozen, module = "dynocar._native")]
pub(crate) struct Table(Vec<RecordBatch>);

#[pymethods]
impl Table {
    /// Returns the table that a pickle has kept.
    #[new]
    fn kept(batches: Vec<Kept<Vec<u8>>>) -> PyResult<Self> {
        let numbers = |bytes: &[u8]| {
            let (numbers, _) = bytes.as_chunks();
            numbers.iter().map(|it| f64::from_ne_bytes(*it)).collect()
        };
        let batches = batches.into_iter().map(|(run, columns)| {
            batch(run, columns.into_iter().map(|(name, bytes)| (name, numbers(&bytes))).collect())
        });
        Ok(Table(batches.collect::<PyResult<_>>()?))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyType>, KeptBatches<'py>) {
        let py = slf.py();
        let kept = |batch: &RecordBatch| {
            let named = || batch.schema_ref().fields().iter().zip(batch.columns());
            let run = named().find_map(|(_, array)| {
                array.as_any().downcast_ref::<UInt32Array>()?.values().first().copied()
            });
            let columns = named().filter_map(|(field, array)| {
                let numbers = array.as_any().downcast_ref::<Float64Array>()?.values();
                let bytes: Vec<u8> = numbers.iter().flat_map(|it| it.to_ne_bytes()).collect();
                Some((field.name().clone(), PyBytes::new(py, &bytes)))
            });
            (run, columns.collect())
        };
        (slf.get_type(), (slf.get().0.iter().map(kept).collect(),))
    }

    /// Returns the columns of numbers of the first batch, with their names.
    fn columns(&self) -> Vec<(String, Column)> {
        let Some(batch) = self.0.first() else { return Vec::new() };
        let named = batch.schema_ref().fields().iter().zip(batch.columns());
        named
            .filter_map(|(field, array)| {
                let numbers = array.as_any().downcast_ref::<Float64Array>()?;
                Some((field.name().clone(), Column(numbers.values().clone())))
            })
            .collect()
    }

    fn __len__(&self) -> usize {
        self.0.iter().map(RecordBatch::num_rows).sum()
    }

    /// Returns a consumer that wants another schema casts by itself, as the protocol allows.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        drop(requested_schema);
        let empty = || PyRuntimeError::new_err("a table without a batch");
        let schema = self.0.first().ok_or_else(empty)?.schema();
        let batches = RecordBatchIterator::new(self.0.clone().into_iter().map(Ok), schema);
        let stream = FFI_ArrowArrayStream::new(Box::new(batches));
        PyCapsule::new_with_value(py, stream, c"arrow_array_stream")
    }
}

impl Table {
    /// Returns a table of one interval of time.
    pub(crate) fn of(columns: Columns) -> PyResult<Self> {
        Ok(Table(vec![batch(None, columns)?]))
    }

    /// Returns the table of each run, and of all of them with a column that numbers the runs. They hold the
    /// quantities of which any run has a value.
    pub(crate) fn of_runs(runs: &[Run]) -> PyResult<(Vec<Self>, Self)> {
        let samples = runs.iter().flat_map(|run| &run.samples);
        let fields = samples.fold(0, |fields, sample| fields | sample.valid);
        let fields = SampleField::ALL.into_iter().filter(|field| fields & field.bit() != 0);
        let fields: Vec<SampleField> = fields.collect();
        let is_known = |(quantity, _): &(Quantity, _)| {
            runs.iter().filter_map(|run| run.extra(*quantity)).flatten().any(Option::is_some)
        };
        let known: Vec<(Quantity, &str)> = EXTRAS.into_iter().filter(is_known).collect();
        let numbered = |run: &Run| batch(Some(run.number), quantities(run, &fields, &known));
        let all = runs.iter().map(numbered).collect::<PyResult<Vec<_>>>()?;
        // The columns after the run's number, in the same memory.
        let alone = |whole: &RecordBatch| -> PyResult<Self> {
            let indices: Vec<usize> = (1..whole.num_columns()).collect();
            Ok(Table(vec![whole.project(&indices).map_err(unexpected)?]))
        };
        Ok((all.iter().map(alone).collect::<PyResult<_>>()?, Table(all)))
    }
}

/// Samples that stay in the processor's cache while one column after the other is taken from them.
const SAMPLES_AT_ONCE: usize = 512;

/// Returns the columns of a run: its times, these quantities of its samples, and of those beyond them.
fn quantities(run: &Run, fields: &[SampleField], known: &[(Quantity, &'static str)]) -> Columns {
    let column = |name: &str| (name.to_owned(), Vec::with_capacity(run.samples.len()));
    let mut times = column("time_s");
    let mut columns: Columns = fields.iter().map(|field| column(field.name())).collect();
    for samples in run.samples.chunks(SAMPLES_AT_ONCE) {
        times.1.extend(samples.iter().map(|it| it.time_ns as f64 / 1e9));
        for (field, (_, values)) in fields.iter().zip(&mut columns) {
            values.extend(samples.iter().map(|it| it.get(*field).unwrap_or(f64::NAN)));
        }
    }
    columns.insert(0, times);
    for (quantity, name) in known {
        let known =
            run.extra(*quantity).into_iter().flatten().map(|value| value.unwrap_or(f64::NAN));
        let whole = known.chain(std::iter::repeat(f64::NAN)).take(run.samples.len());
        columns.push(((*name).to_owned(), whole.collect()));
    }
    columns
}

/// Columns in Arrow's form: a missing value is null there, and NaN in the memory that NumPy sees.
fn batch(run: Option<u32>, columns: Columns) -> PyResult<RecordBatch> {
    let rows = columns.first().map_or(0, |(_, values)| values.len());
    let number =
        run.map(|run| (RUN.to_owned(), Arc::new(UInt32Array::from(vec![run; rows])) as ArrayRef));
    let numbers = columns.into_iter().map(|(name, values)| {
        let is_known = |row: usize| !values[row].is_nan();
        let known = BooleanBuffer::collect_bool(values.len(), is_known);
        let nulls = Some(NullBuffer::new(known)).filter(|it| it.null_count() > 0);
        (name, Arc::new(Float64Array::new(values.into(), nulls)) as ArrayRef)
    });
    let all = number.into_iter().chain(numbers).map(|(name, array)| (name, array, true));
    RecordBatch::try_from_iter_with_nullable(all).map_err(unexpected)
}

fn unexpected(error: impl std::fmt::Display) -> PyErr {
    PyRuntimeError::new_err(error.to_string())
}
