//! A recording as MCAP to a folder of Parquet.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::RecordBatch;
use arrow_schema::SchemaRef;
use dynocar::storage::{Disk, Storage, folder_of, settle};
use dynocar_recording::columns::{Column, EVENTS, Row, SAMPLES, SNAPSHOTS, Source};
use dynocar_recording::joining::read_all;
use dynocar_recording::reading::{Ending, Item, Raw, ReadError, Visitor};
use dynocar_recording::recording::Metadata;
use dynocar_recording::schema::{EVENT, SAMPLE, SNAPSHOT};
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainSample};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::schema::types::ColumnPath;

use crate::cells::{Cells, array_of, schema};
use crate::table::{ATTACHMENTS, KIND, LAYOUT, METADATA, attachments_batch, metadata_batch};

/// Rows that are encoded at a time.
const BATCH_ROWS: usize = 1 << 16;

/// Why a recording does not become Parquet.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A file cannot be written.
    #[error("{}: cannot be written: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What stopped it.
        source: ParquetError,
    },
}

/// What was written.
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
/// See [`WriteError`]; then there is no folder.
pub fn write_folder(paths: &[PathBuf], folder: &Path) -> Result<Written, WriteError> {
    let failed = |source: std::io::Error| WriteError::Write {
        path: folder.into(),
        source: ParquetError::General(source.to_string()),
    };
    std::fs::create_dir(folder).map_err(failed)?;
    let done = written(paths, folder).and_then(|done| {
        Disk.sync_directory(folder_of(folder)).map_err(failed)?;
        Ok(done)
    });
    if done.is_err() {
        // It holds nothing that the recording does not.
        let _ = std::fs::remove_dir_all(folder);
    }
    done
}

fn written(paths: &[PathBuf], folder: &Path) -> Result<Written, WriteError> {
    let mut tables = Tables {
        folder,
        tables: BTreeMap::new(),
        number: 0,
        log_time: 0,
        attached: Vec::new(),
        metadata: Vec::new(),
        written: Written::default(),
        failed: None,
    };
    let endings = read_all(paths, &mut tables)?;
    if let Some(error) = tables.failed.take() {
        return Err(error);
    }
    let is_broken = |it: (&Ending, &PathBuf)| it.0.words(it.1);
    tables.written.broken = endings.iter().zip(paths).filter_map(is_broken).collect();
    if tables.written.samples == 0 {
        let found = tables.tables.into_keys().collect::<Vec<_>>().join(", ");
        let found = if found.is_empty() { "no message of ours".into() } else { found };
        return Err(ReadError::NoSamples { path: paths[0].clone(), found }.into());
    }
    tables.finish()
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
    failed: Option<WriteError>,
}

impl Visitor for Tables<'_> {
    fn item(&mut self, item: Item<'_>) {
        let written = &mut self.written;
        let (count, name, row, kind) = match item {
            Item::Metadata(it) => return self.metadata.push(it.clone()),
            Item::Attachment { name, log_time, content, .. } => {
                return self.attached.push((name, log_time, content.into()));
            }
            Item::Sample(it) => {
                let name = format!("samples-{}", it.train_id);
                (&mut written.samples, name, Row::Sample(*it), &SAMPLE_TABLE)
            }
            Item::Snapshot(it) => {
                let kind = it.pipeline_kind().map_or("unknown", PipelineKind::name);
                let name = format!("snapshots-{}-{}_{kind}", it.train_id, it.pipeline_index);
                (&mut written.snapshots, name, Row::Snapshot((*it).into()), &SNAPSHOT_TABLE)
            }
            Item::Event(it) => {
                (&mut written.events, "events".into(), Row::Event(it.clone()), &EVENT_TABLE)
            }
        };
        *count += 1;
        if self.failed.is_none()
            && let Err(error) = self.put(&name, &row, kind)
        {
            self.failed = Some(error);
        }
    }

    fn raw(&mut self, raw: &Raw<'_>) {
        self.number += 1;
        self.log_time = raw.header.log_time;
        let schema = raw.channel.schema.as_ref().map(|it| it.0.as_str());
        if !matches!(schema, Some(SAMPLE | SNAPSHOT | EVENT)) {
            self.written.left_out += 1;
        }
    }
}

impl Tables<'_> {
    fn put(&mut self, name: &str, row: &Row, kind: &TableKind) -> Result<(), WriteError> {
        if !self.tables.contains_key(name) {
            let path = self.folder.join(format!("{name}.parquet"));
            self.tables.insert(name.into(), Table::new(path, kind)?);
        }
        match self.tables.get_mut(name) {
            Some(table) => table.put(self.number, self.log_time, row),
            None => Ok(()),
        }
    }

    fn finish(self) -> Result<Written, WriteError> {
        let Tables { folder, tables, attached, metadata, written, .. } = self;
        for (name, table) in tables {
            // A file of samples can be handed on alone: it says what the train is.
            let said = name.starts_with("samples-").then_some(&attached);
            table.finish(said.into_iter().flatten())?;
        }
        let others =
            [(ATTACHMENTS, attachments_batch(&attached)), (METADATA, metadata_batch(&metadata))];
        for (kind, batch) in others {
            let path = folder.join(format!("{kind}.parquet"));
            let failed = |source| WriteError::Write { path: path.clone(), source };
            let batch = batch.map_err(|error| failed(error.into()))?;
            let said = KeyValue::new(KIND.to_owned(), kind.to_owned());
            let properties = WriterProperties::builder()
                .set_key_value_metadata(Some(vec![said]))
                .set_compression(COMPRESSION());
            let mut writer = create(&path)
                .and_then(|it| ArrowWriter::try_new(it, batch.schema(), Some(properties.build())))
                .map_err(failed)?;
            let done = writer.write(&batch).and_then(|()| writer.close());
            done.and_then(|_| Ok(settle(&Disk, &path)?)).map_err(failed)?;
        }
        Ok(written)
    }
}

const COMPRESSION: fn() -> Compression = || Compression::ZSTD(ZstdLevel::default());

fn create(path: &Path) -> Result<File, ParquetError> {
    Ok(File::create_new(path)?)
}

/// What a table is one of.
struct TableKind {
    name: &'static str,
    columns: fn() -> &'static [Column],
    /// The layout of its messages.
    layout: &'static str,
}

static SAMPLE_TABLE: TableKind =
    TableKind { name: "samples", columns: || &SAMPLES, layout: TrainSample::WIRE_NAME };
static SNAPSHOT_TABLE: TableKind =
    TableKind { name: "snapshots", columns: || &SNAPSHOTS, layout: ParameterSnapshot::WIRE_NAME };
static EVENT_TABLE: TableKind = TableKind { name: "events", columns: || &EVENTS, layout: EVENT };

/// A table that is written.
struct Table {
    path: PathBuf,
    columns: &'static [Column],
    schema: SchemaRef,
    cells: Vec<Cells>,
    rows: usize,
    writer: ArrowWriter<File>,
}

impl Table {
    fn new(path: PathBuf, kind: &TableKind) -> Result<Self, WriteError> {
        let columns = (kind.columns)();
        let schema = Arc::new(schema(columns));
        let said = [(KIND, kind.name), (LAYOUT, kind.layout)];
        let said = said.map(|(key, value)| KeyValue::new(key.to_owned(), value.to_owned()));
        let properties = properties(columns, said.into());
        let writer = create(&path)
            .and_then(|it| ArrowWriter::try_new(it, Arc::clone(&schema), Some(properties)))
            .map_err(|source| WriteError::Write { path: path.clone(), source })?;
        let cells = vec![Cells::default(); columns.len()];
        Ok(Table { path, columns, schema, cells, rows: 0, writer })
    }

    fn put(&mut self, number: u64, log_time: u64, row: &Row) -> Result<(), WriteError> {
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

    fn flush(&mut self) -> Result<(), WriteError> {
        self.rows = 0;
        let cells = self.cells.iter_mut().map(std::mem::take);
        let arrays = self.columns.iter().zip(cells).map(|(column, cells)| array_of(column, cells));
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), arrays.collect());
        batch
            .map_err(ParquetError::from)
            .and_then(|batch| self.writer.write(&batch))
            .map_err(|source| WriteError::Write { path: self.path.clone(), source })
    }

    /// Ends the file; attached texts of a configuration become metadata.
    fn finish<'a>(
        mut self,
        attached: impl Iterator<Item = &'a (String, u64, Vec<u8>)>,
    ) -> Result<(), WriteError> {
        self.flush()?;
        for (name, _, content) in attached.filter(|it| it.0.starts_with("configuration-")) {
            let text = String::from_utf8_lossy(content).into_owned();
            self.writer.append_key_value_metadata(KeyValue::new(name.clone(), text));
        }
        let Table { path, writer, .. } = self;
        let done = writer.close().and_then(|_| Ok(settle(&Disk, &path)?));
        done.map_err(|source| WriteError::Write { path, source })
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
