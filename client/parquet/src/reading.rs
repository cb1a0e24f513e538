//! A recording as Parquet: a folder, or a file of samples alone.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use arrow_array::{Array, RecordBatch};
use arrow_schema::{DataType, Schema};
use dynocar_recording::columns::{Column, EVENTS, Row, SAMPLES, SNAPSHOTS, Source};
use dynocar_recording::event::Event;
use dynocar_recording::reading::ReadError;
use dynocar_recording::recording::{Metadata, Recording};
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::cells::{Cells, cells_of, data_type};
use crate::error::TableError;
use crate::guarded::guarded;
use crate::table::{
    ATTACHMENTS, Attached, KIND, LAYOUT, METADATA, add_metadata, attachments_batch, attachments_of,
    metadata_batch,
};

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

/// What a recording holds.
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
        return Err(ReadError::NoSamples { path: path.into(), found: found.into() }.into());
    }
    Ok(content)
}

/// The Parquet files of a recording.
fn files(path: &Path) -> Result<Vec<PathBuf>, TableError> {
    let unreadable = |source| TableError::Unreadable { path: path.into(), source };
    if !std::fs::metadata(path).map_err(unreadable)?.is_dir() {
        return Ok(vec![path.into()]);
    }
    let mut files = Vec::new();
    for entry in std::fs::read_dir(path).map_err(unreadable)? {
        let file = entry.map_err(unreadable)?.path();
        if file.extension().is_some_and(|it| it == "parquet") {
            files.push(file);
        }
    }
    files.sort();
    if files.is_empty() {
        return Err(TableError::NotOurs { path: path.into() });
    }
    Ok(files)
}

fn read_file(
    path: &Path,
    is_of_folder: bool,
    content: &mut Content,
    metadata: &mut BTreeMap<u64, Metadata>,
) -> Result<(), TableError> {
    let file =
        File::open(path).map_err(|source| TableError::Unreadable { path: path.into(), source })?;
    let builder = ParquetRecordBatchReaderBuilder::try_new(file)
        .map_err(|it| TableError::not_parquet(path, it))?;
    let said = builder.metadata().file_metadata().key_value_metadata().cloned().unwrap_or_default();
    let value = |key: &str| said.iter().find(|it| it.key == key).and_then(|it| it.value.clone());
    let not_ours = || TableError::NotOurs { path: path.into() };
    let kind = value(KIND).ok_or_else(not_ours)?;
    let schema = builder.schema().clone();
    let batches = builder.build().map_err(|it| TableError::not_parquet(path, it))?;
    let batches = batches.map(|it| it.map_err(|error| TableError::not_parquet(path, error)));
    let (columns, layout): (&[Column], _) = match kind.as_str() {
        "samples" => (&SAMPLES, Some(TrainSample::WIRE_NAME)),
        "snapshots" => (&SNAPSHOTS, Some(ParameterSnapshot::WIRE_NAME)),
        "events" => (&EVENTS, None),
        ATTACHMENTS => {
            require_same(path, attachments_batch(&[]).map(|it| it.schema()), &schema)?;
            for batch in batches {
                content.attached.extend(attachments_of(&batch?));
            }
            return Ok(());
        }
        METADATA => {
            require_same(path, metadata_batch(&[]).map(|it| it.schema()), &schema)?;
            for batch in batches {
                add_metadata(&batch?, metadata);
            }
            return Ok(());
        }
        _ => return Err(not_ours()),
    };
    if let Some(expected) = layout
        && value(LAYOUT).as_deref() != Some(expected)
    {
        let (path, topic) = (path.into(), kind);
        let found = value(LAYOUT).unwrap_or("none".into());
        return Err(ReadError::OtherSchema { path, topic, expected, found }.into());
    }
    if kind == "samples" && !is_of_folder {
        let texts = said.iter().filter(|it| it.key.starts_with("configuration-"));
        let texts =
            texts.filter_map(|it| Some((it.key.clone(), 0, it.value.clone()?.into_bytes())));
        content.attached.extend(texts);
    }
    let indices = indices(path, columns, &schema)?;
    let mut rows_before = 0;
    for batch in batches {
        let batch = batch?;
        take_rows(path, columns, &indices, &batch, rows_before, &mut content.messages)?;
        rows_before += batch.num_rows();
    }
    Ok(())
}

/// Refuses a table whose columns are others than those of a batch of ours.
fn require_same(
    path: &Path,
    ours: Result<arrow_schema::SchemaRef, arrow_schema::ArrowError>,
    found: &Schema,
) -> Result<(), TableError> {
    let ours = ours.map_err(|it| TableError::not_parquet(path, it))?;
    for (index, field) in ours.fields().iter().enumerate() {
        let expected = field.data_type();
        match found.fields().get(index).filter(|it| it.name() == field.name()) {
            None => return Err(no_column(path, field.name(), expected)),
            Some(it) if it.data_type() != expected => {
                return Err(other_type(path, field.name(), expected, it.data_type()));
            }
            Some(_) => {}
        }
    }
    Ok(())
}

fn no_column(path: &Path, column: &str, expected: &DataType) -> TableError {
    TableError::NoColumn {
        path: path.into(),
        column: column.into(),
        expected: expected.to_string(),
    }
}

fn other_type(path: &Path, column: &str, expected: &DataType, found: &DataType) -> TableError {
    TableError::OtherType {
        path: path.into(),
        column: column.into(),
        expected: expected.to_string(),
        found: found.to_string(),
    }
}

/// Where the columns stand in a file; `None` for one that only repeats others.
fn indices(
    path: &Path,
    columns: &[Column],
    schema: &Schema,
) -> Result<Vec<Option<usize>>, TableError> {
    let index = |column: &Column| {
        if column.is_repetition() {
            return Ok(None);
        }
        let expected = data_type(column);
        let index =
            schema.index_of(&column.name).map_err(|_| no_column(path, &column.name, &expected))?;
        let found = schema.field(index).data_type();
        if *found != expected {
            return Err(other_type(path, &column.name, &expected, found));
        }
        Ok(Some(index))
    };
    columns.iter().map(index).collect()
}

fn take_rows(
    path: &Path,
    columns: &[Column],
    indices: &[Option<usize>],
    batch: &RecordBatch,
    rows_before: usize,
    messages: &mut Vec<Logged>,
) -> Result<(), TableError> {
    let row = match columns.last().map(|it| it.source) {
        Some(Source::Event(_)) => Row::Event(Event::default()),
        Some(Source::Rejected(_)) => Row::Snapshot(ParameterSnapshot::empty().into()),
        _ => Row::Sample(TrainSample::empty(TrainId(0))),
    };
    let first = messages.len();
    let none = Logged { number: 0, log_time: 0, row };
    messages.resize(first + batch.num_rows(), none);
    for (column, index) in columns.iter().zip(indices) {
        let Some(index) = index else { continue };
        let array = batch.column(*index);
        if !column.is_nullable && array.null_count() > 0 {
            let row = (0..array.len()).find(|&row| array.is_null(row)).unwrap_or(0);
            let (path, column, row) = (path.into(), column.name.clone(), rows_before + row + 1);
            return Err(TableError::NoValue { path, column, row });
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
