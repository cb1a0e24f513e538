//! The columns of `dynocar_mcap::columns` as Arrow has them: schema, and words as arrays and back.

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Float64Type, Int8Type, Int32Type, Int64Type, TimestampNanosecondType,
    UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef, FixedSizeListArray, PrimitiveArray, StringArray};
use arrow_buffer::NullBuffer;
use arrow_schema::{DataType, Field, Schema, TimeUnit};
use dynocar_mcap::columns::Column;

/// Cells of a column, row after row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    /// Numbers as words, as many for each row as a list has entries; 0 where they are missing.
    pub words: Vec<u64>,
    /// Texts, for a column of them.
    pub texts: Vec<String>,
    /// Whether a row's value is there.
    pub is_there: Vec<bool>,
}

/// The time zone of wall time.
pub const ZONE: &str = "UTC";

/// The type of a column.
pub fn data_type(column: &Column) -> DataType {
    let entry = match column.type_name {
        "f64" => DataType::Float64,
        "i64" => DataType::Int64,
        "i32" => DataType::Int32,
        "i8" => DataType::Int8,
        "u64" => DataType::UInt64,
        "u32" => DataType::UInt32,
        "u16" => DataType::UInt16,
        "u8" => DataType::UInt8,
        "time" => DataType::Timestamp(TimeUnit::Nanosecond, Some(ZONE.into())),
        _ => DataType::Utf8,
    };
    match column.list {
        None => entry,
        Some(entries) => DataType::FixedSizeList(Arc::new(entry_field(entry)), entries as i32),
    }
}

fn entry_field(entry: DataType) -> Field {
    Field::new_list_field(entry, false)
}

/// The schema of a table; each field says its unit, its meaning and the names of its numbers.
pub fn schema(columns: &[Column]) -> Schema {
    let field = |it: &Column| {
        let said =
            [("unit", it.unit.to_owned()), ("meaning", it.meaning.clone()), ("names", it.names())];
        let said = said.into_iter().filter(|it| !it.1.is_empty());
        let said: HashMap<String, String> = said.map(|it| (it.0.to_owned(), it.1)).collect();
        Field::new(&it.name, data_type(it), it.is_nullable).with_metadata(said)
    };
    Schema::new(columns.iter().map(field).collect::<Vec<_>>())
}

/// The number of a word, and back.
trait Number: ArrowPrimitiveType {
    fn of(word: u64) -> Self::Native;
    fn word(number: Self::Native) -> u64;
}

macro_rules! numbers {
    ($($ty:ident: $native:ty),*) => { $(
        impl Number for $ty {
            fn of(word: u64) -> $native {
                word as $native
            }
            fn word(number: $native) -> u64 {
                number as u64
            }
        }
    )* };
}

numbers! {
    Int64Type: i64, Int32Type: i32, Int8Type: i8, UInt64Type: u64, UInt32Type: u32, UInt16Type: u16,
    UInt8Type: u8, TimestampNanosecondType: i64
}

impl Number for Float64Type {
    fn of(word: u64) -> f64 {
        f64::from_bits(word)
    }
    fn word(number: f64) -> u64 {
        number.to_bits()
    }
}

/// Calls a function for the type of a column's entries, which is no text.
macro_rules! of_type {
    ($column:expr, $function:ident($($argument:expr),*)) => {
        match $column.type_name {
            "f64" => $function::<Float64Type>($($argument),*),
            "i64" => $function::<Int64Type>($($argument),*),
            "i32" => $function::<Int32Type>($($argument),*),
            "i8" => $function::<Int8Type>($($argument),*),
            "u64" => $function::<UInt64Type>($($argument),*),
            "u32" => $function::<UInt32Type>($($argument),*),
            "u16" => $function::<UInt16Type>($($argument),*),
            "u8" => $function::<UInt8Type>($($argument),*),
            _ => $function::<TimestampNanosecondType>($($argument),*),
        }
    };
}

/// Cells as an array of a column's type.
pub fn array_of(column: &Column, cells: Cells) -> ArrayRef {
    let nulls = column.is_nullable.then(|| NullBuffer::from(cells.is_there));
    if data_type(column) == DataType::Utf8 {
        return Arc::new(StringArray::from(cells.texts));
    }
    let entry = |nulls| of_type!(column, primitive(&cells.words, nulls));
    match (column.list, data_type(column)) {
        (Some(entries), DataType::FixedSizeList(field, _)) => {
            Arc::new(FixedSizeListArray::new(field, entries as i32, entry(None), None))
        }
        _ => {
            let array = entry(nulls);
            match column.type_name {
                "time" => {
                    let times = array.as_primitive::<TimestampNanosecondType>().clone();
                    Arc::new(times.with_timezone(ZONE))
                }
                _ => array,
            }
        }
    }
}

fn primitive<T: Number>(words: &[u64], nulls: Option<NullBuffer>) -> ArrayRef {
    let numbers: Vec<T::Native> = words.iter().map(|&it| T::of(it)).collect();
    Arc::new(PrimitiveArray::<T>::new(numbers.into(), nulls))
}

/// An array of a column's type as cells.
pub fn cells_of(column: &Column, array: &dyn Array) -> Cells {
    let is_there = (0..array.len()).map(|row| array.is_valid(row)).collect();
    if let Some(texts) = array.as_string_opt::<i32>() {
        let texts = texts.iter().map(|it| it.unwrap_or("").to_owned()).collect();
        return Cells { words: Vec::new(), texts, is_there };
    }
    let words = match array.as_fixed_size_list_opt() {
        // The entries of the rows that the array has, for it may be a part of a longer one.
        Some(list) => {
            (0..list.len()).flat_map(|row| of_type!(column, words_of(&list.value(row)))).collect()
        }
        None => of_type!(column, words_of(array)),
    };
    Cells { words, texts: Vec::new(), is_there }
}

fn words_of<T: Number>(array: &dyn Array) -> Vec<u64> {
    let numbers = array.as_primitive::<T>();
    let word = |row| if numbers.is_valid(row) { T::word(numbers.value(row)) } else { 0 };
    (0..numbers.len()).map(word).collect()
}
