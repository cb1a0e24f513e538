//! The tables of a recording: names, metadata and columns.

use std::sync::{Arc, LazyLock};

use dynocar_mcap::columns::{EVENTS, RecordingColumn, RecordingRow, SAMPLES, SNAPSHOTS};
use dynocar_mcap::event::Event;
use dynocar_mcap::schema::EVENT;
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};
use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as PhysicalType};
use parquet::errors::ParquetError;
use parquet::schema::types::{Type, TypePtr};

/// Key of a file's metadata: the table of a recording that the file holds.
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
