//! The tables of a recording: names, metadata and columns, and the file of a table, written one part of the rows after
//! another.

use std::fs::File;
use std::path::Path;
use std::sync::{Arc, LazyLock};

use dynocar_mcap::columns::{EVENTS, RecordingColumn, RecordingRow, SAMPLES, SNAPSHOTS};
use dynocar_mcap::event::Event;
use dynocar_mcap::schema::EVENT;
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};
use parquet::basic::{
    Compression, Encoding, LogicalType, Repetition, TimeUnit, Type as PhysicalType, ZstdLevel,
};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int32Type, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{Type, TypePtr};

use crate::arrow_schema::encoded;

/// Cells of a column, row after row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    /// Numbers as words, as many for each row as a list has entries; 0 where they are missing.
    pub words: Vec<u64>,
    /// Texts and bytes that are there, for a column of them.
    pub bytes: Vec<ByteArray>,
    /// Whether a row's value is there.
    pub is_there: Vec<bool>,
}

impl Cells {
    /// Adds a row with a word.
    pub fn put_word(&mut self, word: u64) {
        self.words.push(word);
        self.is_there.push(true);
    }

    /// Adds a row with bytes.
    pub fn put_bytes(&mut self, bytes: Option<&[u8]>) {
        self.bytes.extend(bytes.map(ByteArray::from));
        self.is_there.push(bytes.is_some());
    }
}

/// A file of a table.
pub struct TableFile {
    columns: Vec<RecordingColumn>,
    writer: SerializedFileWriter<File>,
}

impl TableFile {
    /// Begins a new file; `said` are its metadata.
    ///
    /// # Errors
    ///
    /// When it cannot be written, or is there already.
    pub fn create(
        path: &Path,
        columns: Vec<RecordingColumn>,
        mut said: Vec<KeyValue>,
    ) -> Result<Self, ParquetError> {
        said.push(encoded(&columns));
        let properties = Arc::new(properties(&columns, said));
        let file = File::create_new(path)?;
        let writer = SerializedFileWriter::new(file, file_schema(&columns)?, properties)?;
        Ok(TableFile { columns, writer })
    }

    /// Adds rows.
    ///
    /// # Errors
    ///
    /// When they cannot be written.
    pub fn write(&mut self, cells: Vec<Cells>) -> Result<(), ParquetError> {
        if cells.iter().all(|it| it.is_there.is_empty()) {
            return Ok(());
        }
        let mut part = self.writer.next_row_group()?;
        for (column, cells) in self.columns.iter().zip(cells) {
            let Some(writer) = part.next_column()? else { break };
            write_column(column, &cells, writer)?;
        }
        part.close()?;
        Ok(())
    }

    /// Adds to the metadata.
    pub fn say(&mut self, said: KeyValue) {
        self.writer.append_key_value_metadata(said);
    }

    /// Ends the file.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn finish(self) -> Result<(), ParquetError> {
        self.writer.close().map(|_| ())
    }
}

fn write_column(
    column: &RecordingColumn,
    cells: &Cells,
    writer: SerializedColumnWriter,
) -> Result<(), ParquetError> {
    match column.type_name {
        "string" | "bytes" => put::<ByteArrayType>(column, &cells.is_there, &cells.bytes, writer),
        "f64" => put_words::<DoubleType>(column, cells, f64::from_bits, writer),
        "time" | "i64" | "u64" => put_words::<Int64Type>(column, cells, u64::cast_signed, writer),
        _ => put_words::<Int32Type>(column, cells, |it| it as i32, writer),
    }
}

/// Writes the words that are there as numbers.
fn put_words<T: DataType>(
    column: &RecordingColumn,
    cells: &Cells,
    number: impl Fn(u64) -> T::T,
    writer: SerializedColumnWriter,
) -> Result<(), ParquetError> {
    let rows = cells.words.chunks(column.list.unwrap_or(1)).zip(&cells.is_there);
    let numbers: Vec<T::T> =
        rows.filter(|it| *it.1).flat_map(|it| it.0).map(|&it| number(it)).collect();
    put::<T>(column, &cells.is_there, &numbers, writer)
}

fn put<T: DataType>(
    column: &RecordingColumn,
    is_there: &[bool],
    values: &[T::T],
    mut writer: SerializedColumnWriter,
) -> Result<(), ParquetError> {
    let (levels, starts) = match column.list {
        Some(entries) => {
            // Each list's first entry begins a row.
            let start = |index| i16::from(index % entries != 0);
            (Some(vec![1; values.len()]), Some((0..values.len()).map(start).collect::<Vec<_>>()))
        }
        None if column.is_nullable => {
            (Some(is_there.iter().map(|it| (*it).into()).collect()), None)
        }
        None => (None, None),
    };
    writer.typed::<T>().write_batch(values, levels.as_deref(), starts.as_deref())?;
    writer.close()
}

/// Returns the numbers by their differences or by their bytes: dictionaries take numbers for the same that are equal
/// but not the same to the bit.
fn properties(columns: &[RecordingColumn], said: Vec<KeyValue>) -> WriterProperties {
    let mut builder = WriterProperties::builder()
        .set_key_value_metadata(Some(said))
        .set_dictionary_enabled(false)
        .set_compression(Compression::ZSTD(ZstdLevel::default()));
    for column in columns {
        let encoding = match column.type_name {
            "string" | "bytes" => continue,
            _ if column.list.is_some() => continue,
            "f64" => Encoding::BYTE_STREAM_SPLIT,
            _ => Encoding::DELTA_BINARY_PACKED,
        };
        builder = builder.set_column_encoding(column.name.as_str().into(), encoding);
    }
    builder.build()
}

/// Key of a file's metadata: which table of a recording it is.
pub const KIND: &str = "dynocar.table";
/// Key of a file's metadata: the layout of its messages.
pub const LAYOUT: &str = "dynocar.layout";
/// The table of attached files.
pub const ATTACHMENTS: &str = "attachments";
/// The table of metadata.
pub const METADATA: &str = "metadata";

/// Name of the entries of lists.
pub const ENTRY: &str = "item";

/// A table of messages.
pub struct TableKind {
    /// Name under [`KIND`].
    pub name: &'static str,
    /// Its columns.
    pub columns: &'static LazyLock<Vec<RecordingColumn>>,
    /// The layout of its messages.
    pub layout: &'static str,
    /// A message of it without content.
    pub empty: fn() -> RecordingRow,
}

/// The tables of messages.
pub static TABLES: [TableKind; 3] = [
    TableKind {
        name: "samples",
        columns: &SAMPLES,
        layout: TrainSample::WIRE_NAME,
        empty: || RecordingRow::Sample(TrainSample::empty(TrainId(0))),
    },
    TableKind {
        name: "snapshots",
        columns: &SNAPSHOTS,
        layout: ParameterSnapshot::WIRE_NAME,
        empty: || RecordingRow::Snapshot(ParameterSnapshot::empty().into()),
    },
    TableKind {
        name: "events",
        columns: &EVENTS,
        layout: EVENT,
        empty: || RecordingRow::Event(Event::default()),
    },
];

/// Returns a column's type in its file.
fn parquet_type(column: &RecordingColumn) -> Result<Type, ParquetError> {
    let repetition = if column.is_nullable { Repetition::OPTIONAL } else { Repetition::REQUIRED };
    let name = if column.list.is_some() { ENTRY } else { &column.name };
    let (physical, logical) = match column.type_name {
        "f64" => (PhysicalType::DOUBLE, None),
        "string" => (PhysicalType::BYTE_ARRAY, Some(LogicalType::String)),
        "bytes" => (PhysicalType::BYTE_ARRAY, None),
        "time" => (PhysicalType::INT64, Some(LogicalType::timestamp(true, TimeUnit::NANOS))),
        "i64" => (PhysicalType::INT64, None),
        "i32" => (PhysicalType::INT32, None),
        _ => {
            let (bits, is_signed) = integer(column);
            let physical = if bits == 64 { PhysicalType::INT64 } else { PhysicalType::INT32 };
            (physical, Some(LogicalType::integer(bits, is_signed)))
        }
    };
    let entry = Type::primitive_type_builder(name, physical).with_repetition(repetition);
    let entry = entry.with_logical_type(logical).build()?;
    if column.list.is_none() {
        return Ok(entry);
    }
    let group = |name, repetition, field| {
        let group = Type::group_type_builder(name).with_repetition(repetition);
        group.with_fields(vec![Arc::new(field)])
    };
    let entries = group("list", Repetition::REPEATED, entry).build()?;
    let list = group(&column.name, Repetition::REQUIRED, entries);
    list.with_logical_type(Some(LogicalType::List)).build()
}

/// Returns the bits of a column's whole numbers, and whether they have a sign.
pub fn integer(column: &RecordingColumn) -> (i8, bool) {
    let (sign, bits) = column.type_name.split_at(1);
    (bits.parse().unwrap_or(64), sign == "i")
}

/// Returns the columns of attached files.
pub fn attachment_columns() -> [RecordingColumn; 3] {
    [
        RecordingColumn::beside("name", "string", false),
        RecordingColumn::beside("log_time", "time", false),
        RecordingColumn::beside("content", "bytes", false),
    ]
}

/// Returns the columns of metadata: a row for each pair, and one without a key for a record that has none.
pub fn metadata_columns() -> [RecordingColumn; 4] {
    [
        RecordingColumn::beside("record", "u64", false),
        RecordingColumn::beside("name", "string", false),
        RecordingColumn::beside("key", "string", true),
        RecordingColumn::beside("value", "string", true),
    ]
}

/// Returns the schema of a table's file.
///
/// # Errors
///
/// None that a caller could cause.
pub fn file_schema(columns: &[RecordingColumn]) -> Result<TypePtr, ParquetError> {
    let fields = columns.iter().map(|it| parquet_type(it).map(Arc::new));
    let fields = fields.collect::<Result<Vec<_>, _>>()?;
    Ok(Arc::new(Type::group_type_builder("schema").with_fields(fields).build()?))
}
