//! Parquet, a folder or a file of samples alone, read as a recording, or written as a new MCAP file.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use dynocar::storage::{Disk, settle};
use dynocar_dataset::formats::PARQUET;
use dynocar_mcap::columns::{ColumnSource, RecordingColumn, RecordingRow};
use dynocar_mcap::error::{ReadProblem, WriteError};
use dynocar_mcap::recording::{Metadata, Recording};
use dynocar_mcap::writing::{McapError, RecordingWriter};
use parquet::data_type::ByteArray;

use crate::file::{
    ColumnReader, FileColumn, ParquetFile, ParquetFileError, TableProblem, damaged, guarded,
};
use crate::table::{
    ATTACHMENTS, KIND, LAYOUT, METADATA, TABLES, TableKind, attachment_columns, metadata_columns,
};

/// A message with its place in the recording and when it was recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct Logged {
    /// The message's place, counted from 1.
    pub number: u64,
    /// When it was recorded, in ns since 1970.
    pub log_time: u64,
    /// The message.
    pub row: RecordingRow,
}

/// An attached file: its name, when it was attached, its content.
pub type Attached = (String, u64, Vec<u8>);

/// Contents of a recording.
#[derive(Debug, Default)]
pub struct ParquetContent {
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
/// Names file and column, and the expected value there.
pub fn read(path: &Path) -> Result<ParquetContent, ParquetFileError> {
    let mut content = ParquetContent::default();
    let mut metadata = BTreeMap::new();
    for file in files(path)? {
        guarded(|| read_file(&file, path.is_dir(), &mut content, &mut metadata))
            .map_err(ParquetFileError::of(&file))?;
    }
    content.metadata.extend(metadata.into_values());
    content.messages.sort_by_key(|it| it.number);
    if !content.messages.iter().any(|it| matches!(it.row, RecordingRow::Sample(_))) {
        let found = if content.messages.is_empty() { "no message" } else { "snapshots and events" };
        let problem = ReadProblem::NoSamples { found: found.into() };
        return Err(ParquetFileError::of(path)(problem));
    }
    Ok(content)
}

/// Returns the Parquet files of a recording.
fn files(path: &Path) -> Result<Vec<PathBuf>, ParquetFileError> {
    let listed = || {
        if !std::fs::metadata(path)?.is_dir() {
            return Ok(vec![path.into()]);
        }
        let entries = std::fs::read_dir(path)?.map(|it| Ok(it?.path()));
        let mut files = entries.collect::<std::io::Result<Vec<PathBuf>>>()?;
        files.retain(|it| PARQUET.is_of(it));
        files.sort();
        if files.is_empty() { Err(TableProblem::NotOurs) } else { Ok(files) }
    };
    listed().map_err(ParquetFileError::of(path))
}

fn read_file(
    path: &Path,
    is_of_folder: bool,
    content: &mut ParquetContent,
    metadata: &mut BTreeMap<u64, Metadata>,
) -> Result<(), TableProblem> {
    let file = ParquetFile::open(File::open(path)?)?;
    let said = file.key_values();
    let value = |key: &str| said.iter().find(|it| it.key == key).and_then(|it| it.value.clone());
    let kind = value(KIND).ok_or(TableProblem::NotOurs)?;
    let table = match kind.as_str() {
        ATTACHMENTS => return read_attached(&file, &mut content.attached),
        METADATA => return read_metadata(&file, metadata),
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
    read_messages(&file, table, &mut content.messages)
}

fn read_attached(file: &ParquetFile, attached: &mut Vec<Attached>) -> Result<(), TableProblem> {
    let [names, times, contents] = attachment_columns();
    let times = numbers_of(file, &times)?.into_iter();
    let names = bytes_of(file, &names)?.into_iter().flatten();
    let contents = bytes_of(file, &contents)?.into_iter().flatten();
    let file = |((name, time), content): ((ByteArray, u64), ByteArray)| {
        (text(&name), time, content.data().to_vec())
    };
    attached.extend(names.zip(times).zip(contents).map(file));
    Ok(())
}

fn read_metadata(
    file: &ParquetFile,
    metadata: &mut BTreeMap<u64, Metadata>,
) -> Result<(), TableProblem> {
    let [numbers, names, keys, values] = metadata_columns();
    let numbers = numbers_of(file, &numbers)?;
    let [names, keys, values] =
        [bytes_of(file, &names)?, bytes_of(file, &keys)?, bytes_of(file, &values)?];
    for (row, number) in numbers.into_iter().enumerate() {
        let name = names[row].as_ref().map(text).unwrap_or_default();
        let none = || Metadata { name, metadata: BTreeMap::new() };
        let record = metadata.entry(number).or_insert_with(none);
        if let (Some(key), Some(value)) = (&keys[row], &values[row]) {
            record.metadata.insert(text(key), text(value));
        }
    }
    Ok(())
}

/// Reads the messages of a table, column after column.
fn read_messages(
    file: &ParquetFile,
    table: &TableKind,
    messages: &mut Vec<Logged>,
) -> Result<(), TableProblem> {
    let own: Vec<&RecordingColumn> =
        table.columns.iter().filter(|it| !it.is_repetition()).collect();
    // Each is there before the first is read.
    let found = own.iter().map(|it| of_file(file, it)).collect::<Result<Vec<_>, _>>()?;
    let first = messages.len();
    for (column, found) in own.into_iter().zip(found) {
        let mut row = first;
        each_cell(file, (column, found), |cell| {
            if row == messages.len() {
                messages.push(Logged { number: 0, log_time: 0, row: (table.empty)() });
            }
            let it = &mut messages[row];
            row += 1;
            match (column.source, cell, &mut it.row) {
                (ColumnSource::Number, Cell::Words(words), _) => it.number = words[0],
                (ColumnSource::LogTime, Cell::Words(words), _) => it.log_time = words[0],
                (_, Cell::Bytes(bytes), RecordingRow::Event(event)) => event.text = text(bytes),
                (_, Cell::Words(words), row) => row.set_words(column, Some(words)),
                (_, _, row) => row.set_words(column, None),
            }
        })?;
    }
    Ok(())
}

fn text(bytes: &ByteArray) -> String {
    String::from_utf8_lossy(bytes.data()).into_owned()
}

/// Returns a file's column, which is refused where it is not there or of another type.
fn of_file<'f>(
    file: &'f ParquetFile,
    expected: &RecordingColumn,
) -> Result<&'f FileColumn, TableProblem> {
    let Some(found) = file.columns.iter().find(|it| it.name == expected.name) else {
        let (column, expected) = (expected.name.clone(), expected.arrow_type());
        return Err(TableProblem::NoColumn { column, expected });
    };
    let is_list = expected.list.is_some();
    let entries = if is_list { found.entries.as_ref() } else { Some(&found.column_type) };
    if entries.is_none_or(|it| it.words != expected.entry_arrow_type()) {
        return Err(found.refused(expected.arrow_type()));
    }
    Ok(found)
}

/// A cell of a table.
enum Cell<'c> {
    /// A number, or the numbers of a list.
    Words(&'c [u64]),
    /// A text or bytes.
    Bytes(&'c ByteArray),
    /// No value.
    Missing,
}

/// Takes the cells of a column, row after row.
fn each_cell(
    file: &ParquetFile,
    (expected, found): (&RecordingColumn, &FileColumn),
    mut take: impl FnMut(Cell<'_>),
) -> Result<(), TableProblem> {
    let is_signed = expected.type_name.starts_with('i');
    let of_short = |it: i32| {
        if is_signed { i64::from(it).cast_unsigned() } else { it.cast_unsigned().into() }
    };
    let (mut rows, mut without_value) = (0, None);
    let mut take = |cell: Cell<'_>| {
        rows += 1;
        if let (Cell::Missing, None) = (&cell, without_value) {
            without_value = Some(rows);
        }
        take(cell);
    };
    file.read(found, |part| {
        let cells = part.cells;
        let mut words = Vec::new();
        macro_rules! each {
            ($reader:expr, $word:expr) => {
                match expected.list {
                    None => cells.each($reader, |it| {
                        take(
                            it.map($word)
                                .as_ref()
                                .map_or(Cell::Missing, |it| Cell::Words(std::slice::from_ref(it))),
                        );
                    }),
                    Some(entries) => cells.each_list($reader, entries, |it| {
                        words.clear();
                        words.extend(it.iter().map($word));
                        take(Cell::Words(&words));
                    }),
                }
            };
        }
        match part.reader {
            ColumnReader::DoubleColumnReader(it) => each!(it, |it| it.to_bits()),
            ColumnReader::Int64ColumnReader(it) => each!(it, |it| it.cast_unsigned()),
            ColumnReader::Int32ColumnReader(it) => each!(it, |it| of_short(*it)),
            ColumnReader::ByteArrayColumnReader(it) => {
                cells.each(it, |it| take(it.map_or(Cell::Missing, Cell::Bytes)))
            }
            _ => Err(damaged("another type than it says")),
        }
    })?;
    match without_value {
        Some(row) if !expected.is_nullable => {
            Err(TableProblem::NoValue { column: expected.name.clone(), row })
        }
        _ => Ok(()),
    }
}

/// Returns the cells of a column, made something else.
fn cells_of<T>(
    file: &ParquetFile,
    column: &RecordingColumn,
    mut make: impl FnMut(Cell<'_>) -> T,
) -> Result<Vec<T>, TableProblem> {
    let mut cells = Vec::new();
    each_cell(file, (column, of_file(file, column)?), |it| cells.push(make(it)))?;
    Ok(cells)
}

fn numbers_of(file: &ParquetFile, column: &RecordingColumn) -> Result<Vec<u64>, TableProblem> {
    cells_of(file, column, |it| if let Cell::Words(words) = it { words[0] } else { 0 })
}

fn bytes_of(
    file: &ParquetFile,
    column: &RecordingColumn,
) -> Result<Vec<Option<ByteArray>>, TableProblem> {
    cells_of(
        file,
        column,
        |it| if let Cell::Bytes(bytes) = it { Some(bytes.clone()) } else { None },
    )
}

impl ParquetContent {
    /// Returns the same as a recording in memory.
    pub fn into_recording(self) -> Recording {
        let mut recording = Recording { metadata: self.metadata, ..Recording::default() };
        recording.attachments = self.attached.into_iter().map(|it| (it.0, it.2)).collect();
        for message in self.messages {
            match message.row {
                RecordingRow::Sample(it) => recording.samples.push(it),
                RecordingRow::Snapshot(it) => recording.snapshots.push(*it),
                RecordingRow::Event(it) => recording.events.push(it),
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
pub fn write_mcap(content: &ParquetContent, path: &Path) -> Result<(), WriteError> {
    let file = File::create_new(path).map_err(WriteError::of(path))?;
    let done = write(content, file).and_then(|()| Ok(settle(&Disk, path)?));
    if done.is_err() {
        let _ = std::fs::remove_file(path);
    }
    done.map_err(WriteError::of(path))
}

fn write(content: &ParquetContent, file: File) -> Result<(), McapError> {
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
