//! Recordings to datasets, without loss.
//!
//! A dataset made of a recording holds each sample as a row with all of its fields under their own names;
//! `dataset.toml` maps those that are quantities of a dataset. From such rows the same samples come back, to the bit. A
//! recording made of a dataset has the dataset's files attached, and gives them back.

mod to_dataset;

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use dynocar::text_file::{require_text, text_of};
use dynocar_analysis::dataset::text_layout::decoded;
use dynocar_analysis::dataset::{
    ColumnMapping, DatasetFiles, FileProblem, Manifest, RunColumn, RunColumns, RunContent, formats,
};
use dynocar_mcap::schema::SAMPLE_FIELDS;
use dynocar_shared::layout::Words;
use dynocar_shared::sample::FLAG_WHEEL_SLIDE;
use dynocar_shared::schema::{Field, Missing};
use dynocar_shared::{TrainId, TrainSample};

use crate::formats::{RunFile, run_reader};

pub use to_dataset::{ModelFiles, ToDatasetError, Unpacked, dataset_of, to_dataset, unpack};

/// Contents of a file.
#[derive(Clone, Debug, PartialEq)]
pub enum FileContent {
    /// Bytes of an attached file.
    Bytes(Vec<u8>),
    /// Samples of a recorded run.
    Samples(Vec<TrainSample>),
}

/// A recording as a dataset.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedDataset {
    recording: PathBuf,
    files: Vec<(String, FileContent)>,
}

impl RecordedDataset {
    /// One without files.
    pub fn new(recording: &Path) -> Self {
        RecordedDataset { recording: recording.into(), files: Vec::new() }
    }

    /// Adds a file, or replaces that of the same name.
    pub fn put(&mut self, name: &str, content: FileContent) {
        self.files.retain(|it| it.0 != name);
        self.files.push((name.into(), content));
    }

    /// Returns the names of its files.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.files.iter().map(|it| it.0.as_str())
    }

    /// Returns the bytes of a file as [`unpack`] writes it; `None` where there is none.
    pub fn bytes(&self, path: &str) -> Option<Cow<'_, [u8]>> {
        Some(match self.file(path)? {
            FileContent::Bytes(bytes) => bytes.into(),
            FileContent::Samples(samples) => to_rows(samples).into_bytes().into(),
        })
    }

    fn file(&self, path: &str) -> Option<&FileContent> {
        // One path may be written in several ways.
        let found = self.files.iter().find(|it| Path::new(&it.0) == Path::new(path));
        found.map(|it| &it.1)
    }
}

impl DatasetFiles for RecordedDataset {
    fn read(&self, path: &str) -> Result<String, FileProblem> {
        text_of(self.bytes(path).ok_or(FileProblem::Missing)?.into_owned())
    }

    fn read_run(&self, path: &str, manifest: &Manifest) -> Result<RunContent, FileProblem> {
        match self.file(path).ok_or(FileProblem::Missing)? {
            FileContent::Samples(samples) => {
                Ok(RunContent::Columns(columns_of_samples(samples, &manifest.columns)))
            }
            FileContent::Bytes(bytes) => {
                if let Some(read) = run_reader(path) {
                    return read(RunFile::Attached(bytes), &manifest.columns, &manifest.train_rows)
                        .map(RunContent::Columns);
                }
                let encoding = manifest.layout.encoding;
                require_text(bytes, encoding)?;
                let text = decoded(bytes.clone(), encoding)?;
                formats::of_run(path).rows(text).map(RunContent::Text)
            }
        }
    }

    fn label(&self, path: &str) -> String {
        format!("{}/{path}", self.recording.display())
    }
}

/// Column of the wheel-slide bit of `flags`, because a column of a dataset cannot be a bit.
pub const WHEEL_SLIDE: &str = "wheel_slide";

/// Error of a text that holds no samples.
#[derive(Debug, thiserror::Error)]
pub enum RowError {
    /// The text is not CSV.
    #[error("{file}: {source}")]
    Csv {
        /// The file.
        file: String,
        /// Place and kind of the error.
        source: csv::Error,
    },
    /// A cell is not a number of its field's type.
    #[error("{file}:{line}: {column} = {cell:?}: expected a number of type {expected}")]
    Cell {
        /// The file.
        file: String,
        /// The line.
        line: u64,
        /// The column.
        column: &'static str,
        /// Contents of the cell.
        cell: String,
        /// The field's type.
        expected: &'static str,
    },
}

fn columns() -> impl Iterator<Item = &'static Field> {
    SAMPLE_FIELDS.iter().filter(|it| it.missing != Missing::SaidByOthers)
}

/// Returns the samples as CSV, one row for each.
pub fn to_rows<'a>(samples: impl IntoIterator<Item = &'a TrainSample>) -> String {
    let names: Vec<_> = columns().map(|it| it.layout.name).collect();
    let mut text = format!("{},{WHEEL_SLIDE}\n", names.join(","));
    for sample in samples {
        let fields = sample.fields();
        for field in columns() {
            text += &cell(field, sample, fields[field.index]);
            text.push(',');
        }
        let is_sliding = sample.flags & FLAG_WHEEL_SLIDE != 0;
        text += if is_sliding { "1\n" } else { "0\n" };
    }
    text
}

fn cell(field: &Field, sample: &TrainSample, words: &dyn Words) -> String {
    let word = words.word(0);
    match (field.missing, field.layout.type_name) {
        (Missing::Unless(quantity), _) if sample.valid & quantity.bit() == 0 => String::new(),
        // The shortest text that reads as the same number.
        (_, "f64") => f64::from_bits(word).to_string(),
        (_, "i64" | "i8") => (word as i64).to_string(),
        _ => word.to_string(),
    }
}

/// Returns the columns of samples that mappings name, as those of a text of [`to_rows`] are read.
pub fn columns_of_samples(samples: &[TrainSample], mappings: &[ColumnMapping]) -> RunColumns {
    let names = columns().map(|it| it.layout.name).chain([WHEEL_SLIDE]);
    let column = |name: &str| {
        let is_mapped = mappings.iter().any(|it| it.names().any(|it| it == name));
        let values = is_mapped.then(|| Vec::with_capacity(samples.len()));
        RunColumn { name: name.into(), values }
    };
    let mut all: Vec<RunColumn> = names.map(column).collect();
    for sample in samples {
        let words = sample.fields();
        let numbers = columns().map(|field| number(field, sample, words[field.index]));
        let is_sliding = f64::from(u8::from(sample.flags & FLAG_WHEEL_SLIDE != 0));
        for (column, number) in all.iter_mut().zip(numbers.chain([is_sliding])) {
            // A negative zero in a cell is read as 0.
            column.values.iter_mut().for_each(|it| it.push(number + 0.0));
        }
    }
    RunColumns { columns: all, trains: None }
}

/// Returns the number of a field, `NaN` where it is missing.
fn number(field: &Field, sample: &TrainSample, words: &dyn Words) -> f64 {
    let word = words.word(0);
    match (field.missing, field.layout.type_name) {
        (Missing::Unless(quantity), _) if sample.valid & quantity.bit() == 0 => f64::NAN,
        (_, "f64") => f64::from_bits(word),
        (_, "i64" | "i8") => word as i64 as f64,
        _ => word as f64,
    }
}

/// Returns true for a text that [`to_rows`] has written.
pub fn is_rows(text: &str) -> bool {
    let header = to_rows([]);
    text.lines().next() == header.lines().next()
}

/// Returns the samples of a text that [`to_rows`] has written; `file` names it in messages.
///
/// # Errors
///
/// Names file, line and column.
pub fn from_rows(file: &str, text: &str) -> Result<Vec<TrainSample>, RowError> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let mut samples = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|source| RowError::Csv { file: file.into(), source })?;
        let mut sample = TrainSample::empty(TrainId(0));
        let mut valid = 0;
        let fields = sample.fields_mut();
        for (field, cell) in columns().zip(record.iter()) {
            match field.missing {
                Missing::Unless(_) if cell.is_empty() => continue,
                Missing::Unless(quantity) => valid |= quantity.bit(),
                _ => {}
            }
            let word = word(field, cell).ok_or_else(|| RowError::Cell {
                file: file.into(),
                line: record.position().map_or(0, |it| it.line()),
                column: field.layout.name,
                cell: cell.into(),
                expected: field.layout.type_name,
            })?;
            fields[field.index].set_word(0, word);
        }
        sample.valid = valid;
        samples.push(sample);
    }
    Ok(samples)
}

fn word(field: &Field, cell: &str) -> Option<u64> {
    Some(match field.layout.type_name {
        "f64" => cell.parse::<f64>().ok()?.to_bits(),
        "i64" => cell.parse::<i64>().ok()? as u64,
        "i8" => cell.parse::<i8>().ok()? as u64,
        "u8" => cell.parse::<u8>().ok()?.into(),
        "u32" => cell.parse::<u32>().ok()?.into(),
        _ => cell.parse::<u64>().ok()?,
    })
}
