//! Parquet, a folder or a file of samples alone, as a recording, and as a new MCAP file.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use arrow_array::{Array, RecordBatch};
use arrow_schema::{ArrowError, DataType, Schema};
use dynocar::storage::{Disk, settle};
use dynocar::unpacking::is_parquet;
use dynocar_mcap::columns::{Column, Row, Source};
use dynocar_mcap::error::{ReadProblem, WriteError};
use dynocar_mcap::recording::{Metadata, Recording};
use dynocar_mcap::writing::{McapError, RecordingWriter};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use super::cells::{Cells, cells_of, data_type};
use super::error::{TableError, TableProblem, guarded};
use super::table::{
    ATTACHMENTS, Attached, KIND, LAYOUT, METADATA, TABLES, TableKind, add_metadata,
    attachments_batch, attachments_of, metadata_batch,
};

/// A reader of a file's rows, before it begins.
pub type Builder = ParquetRecordBatchReaderBuilder<File>;

/// A message with its place in the recording and when it was recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct Logged {
    /// The message's place, counted from 1.
    pub number: u64,
    /// When it was recorded, in ns since 1970.
    pub log_time: u64,
    /// The message.
    pub row: Row,
}

/// Contents of a recording.
#[derive(Debug, Default)]
pub struct Content {
    /// Its messages, in order.
    pub messages: Vec<Logged>,
    /// Attached files.
    pub attached: Vec<Attached>,
    /// Metadata, in order.
    pub metadata: Vec<Metadata>,
}

/// Reads a recording.
///
/// # Errors
///
/// Names file and column, and what was expected there.
pub fn read(path: &Path) -> Result<Content, TableError> {
    let mut content = Content::default();
    let mut metadata = BTreeMap::new();
    for file in files(path)? {
        guarded(&file, || read_file(&file, path.is_dir(), &mut content, &mut metadata))?;
    }
    content.metadata.extend(metadata.into_values());
    content.messages.sort_by_key(|it| it.number);
    if !content.messages.iter().any(|it| matches!(it.row, Row::Sample(_))) {
        let found = if content.messages.is_empty() { "no message" } else { "snapshots and events" };
        let problem = ReadProblem::NoSamples { found: found.into() };
        return Err(TableError::of(path)(problem));
    }
    Ok(content)
}

/// The Parquet files of a recording.
fn files(path: &Path) -> Result<Vec<PathBuf>, TableError> {
    let listed = || {
        if !std::fs::metadata(path)?.is_dir() {
            return Ok(vec![path.into()]);
        }
        let entries = std::fs::read_dir(path)?.map(|it| Ok(it?.path()));
        let mut files = entries.collect::<std::io::Result<Vec<PathBuf>>>()?;
        files.retain(|it| is_parquet(it));
        files.sort();
        if files.is_empty() { Err(TableProblem::NotOurs) } else { Ok(files) }
    };
    listed().map_err(TableError::of(path))
}

/// Opens a file of anybody.
///
/// # Errors
///
/// When the system does not give it, or it is no Parquet.
pub fn open(path: &Path) -> Result<Builder, TableProblem> {
    ParquetRecordBatchReaderBuilder::try_new(File::open(path)?).map_err(TableProblem::not_parquet)
}

fn read_file(
    path: &Path,
    is_of_folder: bool,
    content: &mut Content,
    metadata: &mut BTreeMap<u64, Metadata>,
) -> Result<(), TableProblem> {
    let builder = open(path)?;
    let said = builder.metadata().file_metadata().key_value_metadata().cloned().unwrap_or_default();
    let value = |key: &str| said.iter().find(|it| it.key == key).and_then(|it| it.value.clone());
    let kind = value(KIND).ok_or(TableProblem::NotOurs)?;
    let schema = builder.schema().clone();
    let batches = builder.build().map_err(TableProblem::not_parquet)?;
    let batches = batches.map(|it| it.map_err(TableProblem::not_parquet));
    let table = match kind.as_str() {
        ATTACHMENTS => {
            require_same(attachments_batch(&[]), &schema)?;
            for batch in batches {
                content.attached.extend(attachments_of(&batch?));
            }
            return Ok(());
        }
        METADATA => {
            require_same(metadata_batch(&[]), &schema)?;
            for batch in batches {
                add_metadata(&batch?, metadata);
            }
            return Ok(());
        }
        name => TABLES.iter().find(|it| it.name == name).ok_or(TableProblem::NotOurs)?,
    };
    let (expected, found) = (table.layout, value(LAYOUT).unwrap_or("none".into()));
    if found != expected {
        return Err(ReadProblem::OtherSchema { topic: kind, expected, found }.into());
    }
    if kind == "samples" && !is_of_folder {
        let texts = said.iter().filter(|it| it.key.starts_with("configuration-"));
        let texts =
            texts.filter_map(|it| Some((it.key.clone(), 0, it.value.clone()?.into_bytes())));
        content.attached.extend(texts);
    }
    let indices = indices(table.columns, &schema)?;
    let mut rows_before = 0;
    for batch in batches {
        let batch = batch?;
        take_rows(table, &indices, &batch, rows_before, &mut content.messages)?;
        rows_before += batch.num_rows();
    }
    Ok(())
}

/// Refuses a table whose columns are others than those of a batch of ours.
fn require_same(ours: Result<RecordBatch, ArrowError>, found: &Schema) -> Result<(), TableProblem> {
    let ours = ours.map_err(TableProblem::not_parquet)?;
    for (index, field) in ours.schema().fields().iter().enumerate() {
        let found = found.fields().get(index).filter(|it| it.name() == field.name());
        require(field.name(), field.data_type(), found.map(|it| it.data_type()))?;
    }
    Ok(())
}

/// Refuses a column that is not there or of another type.
fn require(
    column: &str,
    expected: &DataType,
    found: Option<&DataType>,
) -> Result<(), TableProblem> {
    let (column, words) = (column.to_owned(), expected.to_string());
    match found {
        None => Err(TableProblem::NoColumn { column, expected: words }),
        Some(it) if it != expected => {
            Err(TableProblem::OtherType { column, expected: words, found: it.to_string() })
        }
        Some(_) => Ok(()),
    }
}

/// Where the columns stand in a file; `None` for one that only repeats others.
fn indices(columns: &[Column], schema: &Schema) -> Result<Vec<Option<usize>>, TableProblem> {
    let index = |column: &Column| {
        if column.is_repetition() {
            return Ok(None);
        }
        let index = schema.index_of(&column.name).ok();
        let found = index.map(|it| schema.field(it).data_type());
        require(&column.name, &data_type(column), found)?;
        Ok(index)
    };
    columns.iter().map(index).collect()
}

fn take_rows(
    table: &TableKind,
    indices: &[Option<usize>],
    batch: &RecordBatch,
    rows_before: usize,
    messages: &mut Vec<Logged>,
) -> Result<(), TableProblem> {
    let first = messages.len();
    let none = Logged { number: 0, log_time: 0, row: (table.empty)() };
    messages.resize(first + batch.num_rows(), none);
    for (column, index) in table.columns.iter().zip(indices) {
        let Some(index) = index else { continue };
        let array = batch.column(*index);
        if !column.is_nullable && array.null_count() > 0 {
            let row = (0..array.len()).find(|&row| array.is_null(row)).unwrap_or(0);
            let (column, row) = (column.name.clone(), rows_before + row + 1);
            return Err(TableProblem::NoValue { column, row });
        }
        let Cells { words, mut texts, is_there } = cells_of(column, array);
        let width = column.list.unwrap_or(1);
        for (row, it) in messages[first..].iter_mut().enumerate() {
            let words = is_there[row].then(|| words.get(row * width..(row + 1) * width)).flatten();
            match (column.source, &mut it.row) {
                (Source::Number, _) => it.number = words.map_or(0, |it| it[0]),
                (Source::LogTime, _) => it.log_time = words.map_or(0, |it| it[0]),
                (Source::Event(_), Row::Event(event)) if column.type_name == "string" => {
                    event.text = std::mem::take(&mut texts[row]);
                }
                (_, row) => row.set_words(column, words),
            }
        }
    }
    Ok(())
}

impl Content {
    /// The same as a recording in memory.
    pub fn into_recording(self) -> Recording {
        let mut recording = Recording { metadata: self.metadata, ..Recording::default() };
        recording.attachments = self.attached.into_iter().map(|it| (it.0, it.2)).collect();
        for message in self.messages {
            match message.row {
                Row::Sample(it) => recording.samples.push(it),
                Row::Snapshot(it) => recording.snapshots.push(*it),
                Row::Event(it) => recording.events.push(it),
            }
        }
        recording
    }
}

/// Writes a recording; its messages are those from which the Parquet was made.
///
/// # Errors
///
/// When it cannot be written; then there is no file.
pub fn write_mcap(content: &Content, path: &Path) -> Result<(), WriteError> {
    let file = File::create_new(path).map_err(WriteError::of(path))?;
    let done = write(content, file).and_then(|()| Ok(settle(&Disk, path)?));
    if done.is_err() {
        let _ = std::fs::remove_file(path);
    }
    done.map_err(WriteError::of(path))
}

fn write(content: &Content, file: File) -> Result<(), McapError> {
    let mut writer = RecordingWriter::copy(BufWriter::new(file))?;
    for it in &content.metadata {
        let pairs = it.metadata.iter().map(|(key, value)| (key.as_str(), value.clone()));
        writer.metadata(&it.name, &pairs.collect::<Vec<_>>())?;
    }
    for (name, log_time, data) in &content.attached {
        writer.log_next_at(*log_time);
        writer.attach(name, data, 0)?;
    }
    for message in &content.messages {
        writer.log_next_at(message.log_time);
        writer.write(message.row.message())?;
    }
    writer.finish()?.into_inner().map_err(|error| error.into_error())?;
    Ok(())
}
