//! A recording as MCAP to a folder of Parquet.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};

use dynocar::operator::pipeline_name;
use dynocar::storage::{Disk, Storage, folder_of, settle};
use dynocar_mcap::columns::{ColumnSource, RecordingColumn, RecordingRow};
use dynocar_mcap::copying::read_all;
use dynocar_mcap::error::{CopyError, ReadError, ReadProblem, WriteError};
use dynocar_mcap::reading::{FileEnding, Raw, RecordingItem, Visitor};
use dynocar_mcap::recording::Metadata;
use dynocar_mcap::schema::{EVENT, SAMPLE, SNAPSHOT};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;

use crate::reading::Attached;
use crate::table::{
    ATTACHMENTS, KIND, LAYOUT, METADATA, TABLES, TableKind, attachment_columns, metadata_columns,
};
use crate::table_file::{Cells, TableFile};

/// Rows of a part of a file, which is encoded at once.
const PART_ROWS: usize = 1 << 16;

/// Summary of the written files.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Samples.
    pub samples: usize,
    /// Snapshots.
    pub snapshots: usize,
    /// Events.
    pub events: usize,
    /// Messages of others, which have no place in it.
    pub left_out: usize,
    /// Where a file broke off, in words.
    pub broken: Vec<String>,
}

/// Writes a recording, of one that rotated its files in order, as Parquet into a new folder.
///
/// # Errors
///
/// See [`CopyError`]; then there is no folder.
pub fn write_folder(paths: &[PathBuf], folder: &Path) -> Result<Written, CopyError> {
    std::fs::create_dir(folder).map_err(WriteError::of(folder))?;
    let done = written(paths, folder).and_then(|done| {
        Disk.sync_directory(folder_of(folder)).map_err(WriteError::of(folder))?;
        Ok(done)
    });
    if done.is_err() {
        // It holds nothing that the recording does not.
        let _ = std::fs::remove_dir_all(folder);
    }
    done
}

fn written(paths: &[PathBuf], folder: &Path) -> Result<Written, CopyError> {
    let mut tables = Tables {
        folder,
        tables: BTreeMap::new(),
        number: 0,
        log_time: 0,
        attached: Vec::new(),
        metadata: Vec::new(),
        written: Written::default(),
    };
    let endings = read_all(paths, &mut tables)?;
    let is_broken = |it: (&FileEnding, &PathBuf)| it.0.words(it.1);
    tables.written.broken = endings.iter().zip(paths).filter_map(is_broken).collect();
    if tables.written.samples == 0 {
        let found = tables.tables.into_keys().collect::<Vec<_>>().join(", ");
        let found = if found.is_empty() { "no message of ours".into() } else { found };
        return Err(ReadError::of(&paths[0])(ReadProblem::NoSamples { found }).into());
    }
    Ok(tables.finish()?)
}

/// The tables of a recording that is read.
struct Tables<'p> {
    folder: &'p Path,
    tables: BTreeMap<String, Table>,
    /// The newest message's place in the recording.
    number: u64,
    log_time: u64,
    attached: Vec<Attached>,
    metadata: Vec<Metadata>,
    written: Written,
}

impl Visitor for Tables<'_> {
    type Error = CopyError;

    fn item(&mut self, item: RecordingItem<'_>) -> Result<(), CopyError> {
        let written = &mut self.written;
        let (count, name, row, kind) = match item {
            RecordingItem::Metadata(it) => {
                self.metadata.push(it.clone());
                return Ok(());
            }
            RecordingItem::Attachment { name, log_time, content, .. } => {
                self.attached.push((name, log_time, content.into()));
                return Ok(());
            }
            RecordingItem::Sample(it) => {
                let name = format!("samples-{}", it.train_id);
                (&mut written.samples, name, RecordingRow::Sample(*it), &TABLES[0])
            }
            RecordingItem::Snapshot(it) => {
                let pipeline = pipeline_name(it.pipeline_index, it.pipeline_kind());
                let name = format!("snapshots-{}-{pipeline}", it.train_id);
                (&mut written.snapshots, name, RecordingRow::Snapshot((*it).into()), &TABLES[1])
            }
            RecordingItem::Event(it) => {
                (&mut written.events, "events".into(), RecordingRow::Event(it.clone()), &TABLES[2])
            }
        };
        *count += 1;
        let path = self.folder.join(format!("{name}.parquet"));
        let table = match self.tables.entry(name) {
            Entry::Occupied(table) => table.into_mut(),
            Entry::Vacant(place) => {
                place.insert(Table::new(&path, kind).map_err(WriteError::of(&path))?)
            }
        };
        Ok(table.put(self.number, self.log_time, &row).map_err(WriteError::of(&path))?)
    }

    fn raw(&mut self, raw: &Raw<'_>) -> Result<(), CopyError> {
        self.number += 1;
        self.log_time = raw.header.log_time;
        let schema = raw.channel.schema.as_ref().map(|it| it.0.as_str());
        if !matches!(schema, Some(SAMPLE | SNAPSHOT | EVENT)) {
            self.written.left_out += 1;
        }
        Ok(())
    }
}

impl Tables<'_> {
    fn finish(self) -> Result<Written, WriteError> {
        let Tables { folder, tables, attached, metadata, written, .. } = self;
        let path_of = |name: &str| folder.join(format!("{name}.parquet"));
        for (name, table) in tables {
            // A file of samples can be passed on alone: it carries the description of the train.
            let said = name.starts_with("samples-").then_some(&attached);
            let path = path_of(&name);
            table.finish(&path, said.into_iter().flatten()).map_err(WriteError::of(&path))?;
        }
        let others = [
            (ATTACHMENTS, attachment_columns().to_vec(), cells_of_attached(&attached)),
            (METADATA, metadata_columns().to_vec(), cells_of_metadata(&metadata)),
        ];
        for (kind, columns, cells) in others {
            let path = path_of(kind);
            let said = KeyValue::new(KIND.to_owned(), kind.to_owned());
            let write = || {
                let mut file = TableFile::create(&path, columns, vec![said])?;
                file.write(cells)?;
                file.finish()?;
                Ok::<_, ParquetError>(settle(&Disk, &path)?)
            };
            write().map_err(WriteError::of(&path))?;
        }
        Ok(written)
    }
}

/// Attached files as the cells of their table.
fn cells_of_attached(attached: &[Attached]) -> Vec<Cells> {
    let (mut names, mut times, mut contents) = Default::default();
    for (name, time, content) in attached {
        Cells::put_bytes(&mut names, Some(name.as_bytes()));
        Cells::put_word(&mut times, *time);
        Cells::put_bytes(&mut contents, Some(content));
    }
    vec![names, times, contents]
}

/// Metadata as the cells of their table.
fn cells_of_metadata(metadata: &[Metadata]) -> Vec<Cells> {
    let (mut numbers, mut names, mut keys, mut values) = Default::default();
    for (number, it) in metadata.iter().enumerate() {
        let pairs = it.metadata.iter().map(|(key, value)| Some((key.as_bytes(), value.as_bytes())));
        let none = it.metadata.is_empty().then_some(None);
        for pair in pairs.chain(none) {
            Cells::put_word(&mut numbers, number as u64);
            Cells::put_bytes(&mut names, Some(it.name.as_bytes()));
            Cells::put_bytes(&mut keys, pair.map(|it| it.0));
            Cells::put_bytes(&mut values, pair.map(|it| it.1));
        }
    }
    vec![numbers, names, keys, values]
}

/// A table that is written.
struct Table {
    columns: &'static [RecordingColumn],
    cells: Vec<Cells>,
    rows: usize,
    file: TableFile,
}

impl Table {
    fn new(path: &Path, kind: &TableKind) -> Result<Self, ParquetError> {
        let columns: &[RecordingColumn] = kind.columns;
        let said = [(KIND, kind.name), (LAYOUT, kind.layout)];
        let said = said.map(|(key, value)| KeyValue::new(key.to_owned(), value.to_owned()));
        let file = TableFile::create(path, columns.to_vec(), said.into())?;
        Ok(Table { columns, cells: vec![Cells::default(); columns.len()], rows: 0, file })
    }

    fn put(&mut self, number: u64, log_time: u64, row: &RecordingRow) -> Result<(), ParquetError> {
        for (column, cells) in self.columns.iter().zip(&mut self.cells) {
            match (column.source, row) {
                (ColumnSource::Number, _) => cells.put_word(number),
                (ColumnSource::LogTime, _) => cells.put_word(log_time),
                (_, RecordingRow::Event(event)) if column.type_name == "string" => {
                    cells.put_bytes(Some(event.text.as_bytes()));
                }
                _ => {
                    let is_there = row.put_words(column, &mut cells.words);
                    cells.is_there.push(is_there);
                }
            }
        }
        self.rows += 1;
        if self.rows < PART_ROWS { Ok(()) } else { self.flush() }
    }

    fn flush(&mut self) -> Result<(), ParquetError> {
        self.rows = 0;
        self.file.write(self.cells.iter_mut().map(std::mem::take).collect())
    }

    /// Ends the file; attached texts of a configuration become metadata.
    fn finish<'a>(
        mut self,
        path: &Path,
        attached: impl Iterator<Item = &'a Attached>,
    ) -> Result<(), ParquetError> {
        self.flush()?;
        for (name, _, content) in attached.filter(|it| it.0.starts_with("configuration-")) {
            let text = String::from_utf8_lossy(content).into_owned();
            self.file.say(KeyValue::new(name.clone(), text));
        }
        self.file.finish()?;
        Ok(settle(&Disk, path)?)
    }
}
