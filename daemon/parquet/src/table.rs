//! Names of the files of a recording, their metadata, and the tables of attached files and metadata.

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

use arrow_array::cast::AsArray;
use arrow_array::types::{TimestampNanosecondType, UInt64Type};
use arrow_array::{
    Array, ArrayRef, BinaryArray, RecordBatch, StringArray, TimestampNanosecondArray, UInt64Array,
};
use arrow_schema::ArrowError;
use dynocar_mcap::columns::{Column, EVENTS, Row, SAMPLES, SNAPSHOTS};
use dynocar_mcap::event::Event;
use dynocar_mcap::recording::Metadata;
use dynocar_mcap::schema::EVENT;
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};

use crate::cells::ZONE;

/// Key of a file's metadata: which table of a recording it is.
pub const KIND: &str = "dynocar.table";
/// Key of a file's metadata: the layout of its messages.
pub const LAYOUT: &str = "dynocar.layout";
/// A table of messages.
pub struct TableKind {
    /// Name under [`KIND`].
    pub name: &'static str,
    /// Its columns.
    pub columns: &'static LazyLock<Vec<Column>>,
    /// The layout of its messages.
    pub layout: &'static str,
    /// A message of it without content.
    pub empty: fn() -> Row,
}

/// The tables of messages.
pub static TABLES: [TableKind; 3] = [
    TableKind {
        name: "samples",
        columns: &SAMPLES,
        layout: TrainSample::WIRE_NAME,
        empty: || Row::Sample(TrainSample::empty(TrainId(0))),
    },
    TableKind {
        name: "snapshots",
        columns: &SNAPSHOTS,
        layout: ParameterSnapshot::WIRE_NAME,
        empty: || Row::Snapshot(ParameterSnapshot::empty().into()),
    },
    TableKind {
        name: "events",
        columns: &EVENTS,
        layout: EVENT,
        empty: || Row::Event(Event::default()),
    },
];

/// The table of attached files.
pub const ATTACHMENTS: &str = "attachments";
/// The table of metadata.
pub const METADATA: &str = "metadata";

/// An attached file: its name, when it was attached, its content.
pub type Attached = (String, u64, Vec<u8>);

/// Attached files as a table.
///
/// # Errors
///
/// None that a caller could cause.
pub fn attachments_batch(attached: &[Attached]) -> Result<RecordBatch, ArrowError> {
    let names = attached.iter().map(|it| Some(it.0.as_str()));
    let times: Vec<i64> = attached.iter().map(|it| it.1 as i64).collect();
    let contents = attached.iter().map(|it| Some(it.2.as_slice()));
    RecordBatch::try_from_iter_with_nullable([
        ("name", Arc::new(names.collect::<StringArray>()) as ArrayRef, false),
        (
            "log_time",
            Arc::new(TimestampNanosecondArray::from(times).with_timezone(ZONE)) as ArrayRef,
            false,
        ),
        ("content", Arc::new(contents.collect::<BinaryArray>()) as ArrayRef, false),
    ])
}

/// Metadata as a table: a row for each pair, and one without a key for a record that has none.
///
/// # Errors
///
/// None that a caller could cause.
pub fn metadata_batch(metadata: &[Metadata]) -> Result<RecordBatch, ArrowError> {
    let rows = metadata.iter().enumerate().flat_map(|(index, it)| {
        let pairs = it.metadata.iter().map(|(key, value)| Some((key.as_str(), value.as_str())));
        let none = it.metadata.is_empty().then_some(None);
        pairs.chain(none).map(move |pair| (index as u64, it.name.as_str(), pair))
    });
    let rows: Vec<_> = rows.collect();
    let numbers: UInt64Array = rows.iter().map(|it| Some(it.0)).collect();
    let names: StringArray = rows.iter().map(|it| Some(it.1)).collect();
    let keys: StringArray = rows.iter().map(|it| it.2.map(|pair| pair.0)).collect();
    let values: StringArray = rows.iter().map(|it| it.2.map(|pair| pair.1)).collect();
    RecordBatch::try_from_iter_with_nullable([
        ("record", Arc::new(numbers) as ArrayRef, false),
        ("name", Arc::new(names) as ArrayRef, false),
        ("key", Arc::new(keys) as ArrayRef, true),
        ("value", Arc::new(values) as ArrayRef, true),
    ])
}

/// The attached files of a table that has their columns.
pub fn attachments_of(batch: &RecordBatch) -> Vec<Attached> {
    let (names, contents) =
        (batch.column(0).as_string::<i32>(), batch.column(2).as_binary::<i32>());
    let times = batch.column(1).as_primitive::<TimestampNanosecondType>();
    let row = |row| (names.value(row).into(), times.value(row) as u64, contents.value(row).into());
    (0..batch.num_rows()).map(row).collect()
}

/// Adds the rows of a table that has the columns of metadata.
pub fn add_metadata(batch: &RecordBatch, metadata: &mut BTreeMap<u64, Metadata>) {
    let numbers = batch.column(0).as_primitive::<UInt64Type>();
    let [names, keys, values] = [1, 2, 3].map(|it| batch.column(it).as_string::<i32>());
    for row in 0..batch.num_rows() {
        let name = names.value(row).to_owned();
        let none = || Metadata { name, metadata: BTreeMap::new() };
        let record = metadata.entry(numbers.value(row)).or_insert_with(none);
        if keys.is_valid(row) && values.is_valid(row) {
            record.metadata.insert(keys.value(row).into(), values.value(row).into());
        }
    }
}
