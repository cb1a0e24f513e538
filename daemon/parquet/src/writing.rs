//! A recording as MCAP to a folder of Parquet.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::RecordBatch;
use arrow_schema::SchemaRef;
use dynocar::operator::pipeline_name;
use dynocar::storage::{Disk, Storage, folder_of, settle};
use dynocar_mcap::columns::{Column, Row, Source};
use dynocar_mcap::error::ReadProblem;
use dynocar_mcap::error::{CopyError, ReadError, WriteError};
use dynocar_mcap::joining::read_all;
use dynocar_mcap::reading::{Ending, Item, Raw, Visitor};
use dynocar_mcap::recording::Metadata;
use dynocar_mcap::schema::{EVENT, SAMPLE, SNAPSHOT};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::schema::types::ColumnPath;

use crate::cells::{Cells, array_of, schema};
use crate::table::{
    ATTACHMENTS, KIND, LAYOUT, METADATA, TABLES, TableKind, attachments_batch, metadata_batch,
};

/// Rows that are encoded at a time.
const BATCH_ROWS: usize = 1 << 16;

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
    let is_broken = |it: (&Ending, &PathBuf)| it.0.words(it.1);
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
    attached: Vec<(String, u64, Vec<u8>)>,
    metadata: Vec<Metadata>,
    written: Written,
}

impl Visitor for Tables<'_> {
    type Error = CopyError;

    fn item(&mut self, item: Item<'_>) -> Result<(), CopyError> {
        let written = &mut self.written;
        let (count, name, row, kind) = match item {
            Item::Metadata(it) => {
                self.metadata.push(it.clone());
                return Ok(());
            }
            Item::Attachment { name, log_time, content, .. } => {
                self.attached.push((name, log_time, content.into()));
                return Ok(());
            }
            Item::Sample(it) => {
                let name = format!("samples-{}", it.train_id);
                (&mut written.samples, name, Row::Sample(*it), &TABLES[0])
            }
            Item::Snapshot(it) => {
                let pipeline = pipeline_name(it.pipeline_index, it.pipeline_kind());
                let name = format!("snapshots-{}-{pipeline}", it.train_id);
                (&mut written.snapshots, name, Row::Snapshot((*it).into()), &TABLES[1])
            }
            Item::Event(it) => {
                (&mut written.events, "events".into(), Row::Event(it.clone()), &TABLES[2])
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
            // A file of samples can be handed on alone: it says what the train is.
            let said = name.starts_with("samples-").then_some(&attached);
            let path = path_of(&name);
            table.finish(&path, said.into_iter().flatten()).map_err(WriteError::of(&path))?;
        }
        let others =
            [(ATTACHMENTS, attachments_batch(&attached)), (METADATA, metadata_batch(&metadata))];
        for (kind, batch) in others {
            let path = path_of(kind);
            let write = |batch: RecordBatch| {
                let said = KeyValue::new(KIND.to_owned(), kind.to_owned());
                let properties = WriterProperties::builder()
                    .set_key_value_metadata(Some(vec![said]))
                    .set_compression(COMPRESSION())
                    .build();
                let file = File::create_new(&path)?;
                let mut writer = ArrowWriter::try_new(file, batch.schema(), Some(properties))?;
                writer.write(&batch)?;
                end(writer, &path)
            };
            batch.map_err(ParquetError::from).and_then(write).map_err(WriteError::of(&path))?;
        }
        Ok(written)
    }
}

/// Ends a file, and brings it to the disk.
fn end(writer: ArrowWriter<File>, path: &Path) -> Result<(), ParquetError> {
    writer.close()?;
    Ok(settle(&Disk, path)?)
}

const COMPRESSION: fn() -> Compression = || Compression::ZSTD(ZstdLevel::default());

/// A table that is written.
struct Table {
    columns: &'static [Column],
    schema: SchemaRef,
    cells: Vec<Cells>,
    rows: usize,
    writer: ArrowWriter<File>,
}

impl Table {
    fn new(path: &Path, kind: &TableKind) -> Result<Self, ParquetError> {
        let columns: &[Column] = kind.columns;
        let schema = Arc::new(schema(columns));
        let said = [(KIND, kind.name), (LAYOUT, kind.layout)];
        let said = said.map(|(key, value)| KeyValue::new(key.to_owned(), value.to_owned()));
        let properties = properties(columns, said.into());
        let file = File::create_new(path)?;
        let writer = ArrowWriter::try_new(file, Arc::clone(&schema), Some(properties))?;
        let cells = vec![Cells::default(); columns.len()];
        Ok(Table { columns, schema, cells, rows: 0, writer })
    }

    fn put(&mut self, number: u64, log_time: u64, row: &Row) -> Result<(), ParquetError> {
        for (column, cells) in self.columns.iter().zip(&mut self.cells) {
            let is_there = match (column.source, row) {
                (Source::Number, _) => {
                    cells.words.push(number);
                    true
                }
                (Source::LogTime, _) => {
                    cells.words.push(log_time);
                    true
                }
                (_, Row::Event(event)) if column.type_name == "string" => {
                    cells.texts.push(event.text.clone());
                    true
                }
                _ => row.put_words(column, &mut cells.words),
            };
            cells.is_there.push(is_there);
        }
        self.rows += 1;
        if self.rows < BATCH_ROWS { Ok(()) } else { self.flush() }
    }

    fn flush(&mut self) -> Result<(), ParquetError> {
        self.rows = 0;
        let cells = self.cells.iter_mut().map(std::mem::take);
        let arrays = self.columns.iter().zip(cells).map(|(column, cells)| array_of(column, cells));
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), arrays.collect())?;
        self.writer.write(&batch)
    }

    /// Ends the file; attached texts of a configuration become metadata.
    fn finish<'a>(
        mut self,
        path: &Path,
        attached: impl Iterator<Item = &'a (String, u64, Vec<u8>)>,
    ) -> Result<(), ParquetError> {
        self.flush()?;
        for (name, _, content) in attached.filter(|it| it.0.starts_with("configuration-")) {
            let text = String::from_utf8_lossy(content).into_owned();
            self.writer.append_key_value_metadata(KeyValue::new(name.clone(), text));
        }
        end(self.writer, path)
    }
}

/// Numbers by their differences or by their bytes: dictionaries take numbers for the same that are equal but
/// not the same to the bit.
fn properties(columns: &[Column], said: Vec<KeyValue>) -> WriterProperties {
    let mut builder = WriterProperties::builder()
        .set_key_value_metadata(Some(said))
        .set_dictionary_enabled(false)
        .set_compression(COMPRESSION());
    for column in columns {
        let encoding = match column.type_name {
            "string" => continue,
            "f64" => Encoding::BYTE_STREAM_SPLIT,
            _ => Encoding::DELTA_BINARY_PACKED,
        };
        let mut path = vec![column.name.clone()];
        if column.list.is_some() {
            path.extend(["list".to_owned(), "element".to_owned()]);
        }
        builder = builder.set_column_encoding(ColumnPath::new(path), encoding);
    }
    builder.build()
}
