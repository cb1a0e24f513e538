//! The tables of a recording: names, metadata and columns.
//!
//! Programs that use Arrow leave Arrow's schema in a Parquet file, and so do these tables. It states facts that Parquet
//! cannot state: that numbers are times, and the units and meanings of columns.

use std::sync::{Arc, LazyLock};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dynocar_mcap::columns::{EVENTS, RecordingColumn, RecordingRow, SAMPLES, SNAPSHOTS};
use dynocar_mcap::event::Event;
use dynocar_mcap::schema::EVENT;
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};
use flatbuffers::{FlatBufferBuilder, ForwardsUOffset, UnionWIPOffset, Vector, WIPOffset};
use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as PhysicalType};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
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

/// Key of a file's metadata that holds Arrow's schema.
pub const KEY: &str = "ARROW:schema";

/// A type according to Arrow's schema, as far as Parquet's does not show it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hint {
    /// Whole numbers are times.
    Time {
        /// Arrow's name of these.
        name: &'static str,
        /// Times in a second.
        per_second: u64,
    },
    /// Whole numbers are days.
    Date,
    /// Bytes are text.
    Text,
    /// Nothing more.
    None,
}

/// Numbers of Arrow's types.
mod types {
    pub const INT: u8 = 2;
    pub const FLOATING_POINT: u8 = 3;
    pub const BINARY: u8 = 4;
    pub const UTF8: u8 = 5;
    pub const DATE: u8 = 8;
    pub const TIME: u8 = 9;
    pub const TIMESTAMP: u8 = 10;
    pub const FIXED_SIZE_LIST: u8 = 16;
    pub const DURATION: u8 = 18;
    pub const LARGE_UTF8: u8 = 20;
    pub const UTF8_VIEW: u8 = 24;
}

/// Numbers of a field's parts.
mod parts {
    pub const NAME: u16 = 0;
    pub const IS_NULLABLE: u16 = 1;
    pub const TYPE_NUMBER: u16 = 2;
    pub const TYPE: u16 = 3;
    pub const CHILDREN: u16 = 5;
    pub const METADATA: u16 = 6;
}

/// Returns the hint of each column in a file's metadata, in order; none where they hold no schema of Arrow's.
pub fn hints(said: &[KeyValue]) -> Vec<Hint> {
    let encoded = said.iter().find(|it| it.key == KEY).and_then(|it| it.value.as_deref());
    let bytes = encoded.and_then(|it| STANDARD.decode(it).ok()).unwrap_or_default();
    // The newer form begins with a mark and a length.
    let bytes =
        bytes.strip_prefix(&[255; 4]).map_or(&bytes[..], |it| it.get(4..).unwrap_or_default());
    fields(Buffer(bytes)).unwrap_or_default()
}

fn fields(buffer: Buffer) -> Option<Vec<Hint>> {
    let message = buffer.follow(0)?;
    let schema = buffer.follow(buffer.part(message, 2)?)?;
    let fields = buffer.follow(buffer.part(schema, 1)?)?;
    let count = buffer.u32(fields)? as usize;
    (0..count).map(|index| hint(&buffer, buffer.follow(fields + 4 + 4 * index)?)).collect()
}

fn hint(buffer: &Buffer, field: usize) -> Option<Hint> {
    let number = *buffer.0.get(buffer.part(field, parts::TYPE_NUMBER)?)?;
    let name = match number {
        types::TIME => "Time",
        types::TIMESTAMP => "Timestamp",
        types::DURATION => "Duration",
        types::DATE => return Some(Hint::Date),
        types::UTF8 | types::LARGE_UTF8 | types::UTF8_VIEW => return Some(Hint::Text),
        _ => return Some(Hint::None),
    };
    let of_type = buffer.follow(buffer.part(field, parts::TYPE)?)?;
    // A unit that is left out is the usual one.
    let usual = u32::from(number != types::TIMESTAMP);
    let unit = buffer.part(of_type, 0).and_then(|it| buffer.u16(it)).map_or(usual, u32::from);
    Some(Hint::Time { name, per_second: 1000u64.checked_pow(unit)? })
}

/// Bytes laid out by flatbuffers; a part that does not lie within them counts as missing.
struct Buffer<'b>(&'b [u8]);

impl Buffer<'_> {
    fn u16(&self, at: usize) -> Option<u16> {
        Some(u16::from_le_bytes(*self.0.get(at..)?.first_chunk()?))
    }

    fn u32(&self, at: usize) -> Option<u32> {
        Some(u32::from_le_bytes(*self.0.get(at..)?.first_chunk()?))
    }

    /// Returns where the reference at a place leads.
    fn follow(&self, at: usize) -> Option<usize> {
        at.checked_add(self.u32(at)? as usize)
    }

    /// Returns where a part of a table lies; `None` where it is left out.
    fn part(&self, table: usize, number: u16) -> Option<usize> {
        let back = self.u32(table)?.cast_signed() as isize;
        let places = table.checked_add_signed(back.checked_neg()?)?;
        let place = 4 + 2 * number;
        let offset =
            (place < self.u16(places)?).then(|| self.u16(places + usize::from(place)))??;
        (offset != 0).then_some(table + usize::from(offset))
    }
}

type Bytes = FlatBufferBuilder<'static>;
/// A table that is written.
type Table = WIPOffset<UnionWIPOffset>;
/// Tables that are written.
type Tables = WIPOffset<Vector<'static, ForwardsUOffset<UnionWIPOffset>>>;

/// Returns the schema of a table of ours, each column with its unit, its meaning and the names of its numbers.
pub fn encoded(columns: &[RecordingColumn]) -> KeyValue {
    let mut bytes = FlatBufferBuilder::new();
    let fields: Vec<Table> = columns.iter().map(|it| field(&mut bytes, it)).collect();
    let fields: Tables = bytes.create_vector(&fields);
    let schema = table(&mut bytes, |it| it.push_slot_always(slot(1), fields));
    let message = table(&mut bytes, |it| {
        // The newest layout, and that this is a schema.
        it.push_slot_always(slot(2), schema);
        it.push_slot_always(slot(0), 4i16);
        it.push_slot_always(slot(1), 1u8);
    });
    bytes.finish_minimal(message);
    let content = bytes.finished_data();
    let mut framed = vec![255; 4];
    framed.extend((content.len() as u32).to_le_bytes());
    framed.extend(content);
    KeyValue::new(KEY.to_owned(), STANDARD.encode(framed))
}

fn slot(number: u16) -> u16 {
    4 + 2 * number
}

fn table(bytes: &mut Bytes, parts: impl FnOnce(&mut Bytes)) -> Table {
    let start = bytes.start_table();
    parts(bytes);
    WIPOffset::new(bytes.end_table(start).value())
}

fn field(bytes: &mut Bytes, column: &RecordingColumn) -> Table {
    let said = [("unit", column.unit), ("meaning", &column.meaning), ("names", &column.names())];
    let said: Vec<Table> = said
        .into_iter()
        .filter(|it| !it.1.is_empty())
        .map(|(key, value)| {
            let (key, value) = (bytes.create_string(key), bytes.create_string(value));
            table(bytes, |it| {
                it.push_slot_always(slot(0), key);
                it.push_slot_always(slot(1), value);
            })
        })
        .collect();
    let said: Tables = bytes.create_vector(&said);
    let mut of_type = entry_type(bytes, column);
    let mut children = Vec::new();
    if let Some(entries) = column.list {
        children.push(named(bytes, ENTRY, false, of_type, None));
        let list = table(bytes, |it| it.push_slot_always(slot(0), entries as i32));
        of_type = (types::FIXED_SIZE_LIST, list);
    }
    let children: Tables = bytes.create_vector(&children);
    named(bytes, &column.name, column.is_nullable, of_type, Some((children, said)))
}

fn named(
    bytes: &mut Bytes,
    name: &str,
    is_nullable: bool,
    (number, of_type): (u8, Table),
    rest: Option<(Tables, Tables)>,
) -> Table {
    let name = bytes.create_string(name);
    let (children, said) = rest.unwrap_or_else(|| {
        let none: [Table; 0] = [];
        (bytes.create_vector(&none), bytes.create_vector(&none))
    });
    table(bytes, |it| {
        it.push_slot_always(slot(parts::NAME), name);
        it.push_slot_always(slot(parts::TYPE), of_type);
        it.push_slot_always(slot(parts::CHILDREN), children);
        it.push_slot_always(slot(parts::METADATA), said);
        it.push_slot_always(slot(parts::IS_NULLABLE), is_nullable);
        it.push_slot_always(slot(parts::TYPE_NUMBER), number);
    })
}

fn entry_type(bytes: &mut Bytes, column: &RecordingColumn) -> (u8, Table) {
    match column.type_name {
        "f64" => (types::FLOATING_POINT, table(bytes, |it| it.push_slot_always(slot(0), 2i16))),
        "time" => {
            let zone = bytes.create_string("UTC");
            let time = table(bytes, |it| {
                it.push_slot_always(slot(1), zone);
                it.push_slot_always(slot(0), 3i16);
            });
            (types::TIMESTAMP, time)
        }
        "string" => (types::UTF8, table(bytes, |_| {})),
        "bytes" => (types::BINARY, table(bytes, |_| {})),
        _ => {
            let (bits, is_signed) = integer(column);
            let integer = table(bytes, |it| {
                it.push_slot_always(slot(0), i32::from(bits));
                it.push_slot_always(slot(1), is_signed);
            });
            (types::INT, integer)
        }
    }
}
