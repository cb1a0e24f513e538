//! A Parquet file of anybody as CSV: all its columns by name, and what the wanted ones hold.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Decimal32Type, Decimal64Type, Decimal128Type, Decimal256Type, DecimalType,
    DurationMicrosecondType, DurationMillisecondType, DurationNanosecondType, DurationSecondType,
    Float16Type, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type,
    Time32MillisecondType, Time32SecondType, Time64MicrosecondType, Time64NanosecondType,
    TimestampMicrosecondType, TimestampMillisecondType, TimestampNanosecondType,
    TimestampSecondType, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, RecordBatch};
use arrow_schema::{DataType, Schema, TimeUnit};
use dynocar_model::units::{Dimension, Unit};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::error::TableError;
use crate::guarded::guarded;

/// A column that is wanted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Its name.
    pub column: String,
    /// The unit in which its numbers are wanted, which a column of times is converted to.
    pub unit: String,
}

/// Why rows are not given.
#[derive(Debug, thiserror::Error)]
pub enum RowsError {
    /// The file cannot be read.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The rows cannot be written.
    #[error("standard output: cannot be written: {0}")]
    Output(#[from] csv::Error),
}

/// Writes a file's rows as CSV: a header with all its columns, and the cells of the wanted ones; what is
/// missing is empty, true is 1 and false 0. A wanted column that is not there is left out.
///
/// # Errors
///
/// When the file cannot be read, a wanted column holds neither numbers nor truths nor times, or the rows cannot
/// be written.
pub fn write_rows(path: &Path, wanted: &[Wanted], output: impl Write) -> Result<(), RowsError> {
    guarded(path, || rows(path, wanted, output))
}

fn rows(path: &Path, wanted: &[Wanted], output: impl Write) -> Result<(), RowsError> {
    let file =
        File::open(path).map_err(|source| TableError::Unreadable { path: path.into(), source })?;
    let builder = ParquetRecordBatchReaderBuilder::try_new(file)
        .map_err(|it| TableError::not_parquet(path, it))?;
    let schema = builder.schema().clone();
    // Without every wanted column there is nothing to read: the header says which there are.
    let names: Vec<&str> = schema.fields().iter().map(|it| it.name().as_str()).collect();
    let is_complete =
        wanted.iter().all(|it| names.iter().filter(|name| **name == it.column).count() == 1);
    let mut output = csv::WriterBuilder::new().flexible(true).from_writer(output);
    if !is_complete {
        output.write_record(&names)?;
        output.flush().map_err(csv::Error::from)?;
        return Ok(());
    }
    let readers =
        wanted.iter().map(|it| reader(path, &schema, it)).collect::<Result<Vec<_>, _>>()?;
    let roots: Vec<usize> = readers.iter().map(|it| it.index).collect();
    let mask = ProjectionMask::roots(builder.parquet_schema(), roots.iter().copied());
    let batches =
        builder.with_projection(mask).build().map_err(|it| TableError::not_parquet(path, it))?;
    output.write_record(&names)?;
    let mut cells = vec![String::new(); names.len()];
    for batch in batches {
        let batch = batch.map_err(|it| TableError::not_parquet(path, it))?;
        let columns = columns_of(&batch, &roots);
        for row in 0..batch.num_rows() {
            for (reader, column) in readers.iter().zip(&columns) {
                let array = batch.column(*column);
                let cell = &mut cells[reader.index];
                cell.clear();
                if array.is_valid(row) {
                    (reader.read)(array.as_ref(), row, cell);
                }
            }
            output.write_record(&cells)?;
        }
    }
    output.flush().map_err(csv::Error::from)?;
    Ok(())
}

/// Where the columns of a file stand in a batch of a part of them.
fn columns_of(batch: &RecordBatch, roots: &[usize]) -> Vec<usize> {
    let mut sorted = roots.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    debug_assert_eq!(sorted.len(), batch.num_columns());
    roots.iter().map(|root| sorted.iter().position(|it| it == root).unwrap_or(0)).collect()
}

/// Appends the text of a row's value.
type Read = Box<dyn Fn(&dyn Array, usize, &mut String)>;

struct Reader {
    index: usize,
    read: Read,
}

fn reader(path: &Path, schema: &Schema, wanted: &Wanted) -> Result<Reader, TableError> {
    let index = schema.fields().iter().position(|it| *it.name() == wanted.column).unwrap_or(0);
    let found = schema.field(index).data_type();
    let refuse = |expected: String| TableError::OtherType {
        path: PathBuf::from(path),
        column: wanted.column.clone(),
        expected,
        found: found.to_string(),
    };
    if let Some((per_second, count)) = times(found) {
        let unit = Unit::find(Dimension::Time, &wanted.unit)
            .ok_or_else(|| refuse(format!("numbers in {}", wanted.unit)))?;
        let seconds = Unit::base_of(Dimension::Time);
        let read: Read = Box::new(move |array, row, cell| {
            let count = count(array, row);
            let (sign, count) = (if count < 0 { "-" } else { "" }, count.unsigned_abs());
            let (whole, part) = (count / per_second, count % per_second);
            let time_s = format!("{sign}{whole}.{:09}", part * (1_000_000_000 / per_second));
            if unit.name() == seconds.name() {
                // As text it keeps every digit.
                cell.push_str(&time_s);
            } else {
                let time_s: f64 = time_s.parse().unwrap_or(f64::NAN);
                cell.push_str(&seconds.convert(time_s, &unit).to_string());
            }
        });
        return Ok(Reader { index, read });
    }
    let read = numbers(found).ok_or_else(|| refuse("numbers, true and false, or times".into()))?;
    Ok(Reader { index, read })
}

fn number<T: ArrowPrimitiveType>() -> Read
where
    T::Native: std::fmt::Display,
{
    Box::new(|array, row, cell| {
        cell.push_str(&array.as_primitive::<T>().value(row).to_string());
    })
}

fn decimal<T: DecimalType>() -> Read {
    Box::new(|array, row, cell| cell.push_str(&array.as_primitive::<T>().value_as_string(row)))
}

/// How a column's values become texts of numbers; `None` where they are none.
fn numbers(found: &DataType) -> Option<Read> {
    Some(match found {
        DataType::Boolean => Box::new(|array, row, cell| {
            cell.push(if array.as_boolean().value(row) { '1' } else { '0' });
        }),
        DataType::Int8 => number::<Int8Type>(),
        DataType::Int16 => number::<Int16Type>(),
        DataType::Int32 => number::<Int32Type>(),
        DataType::Int64 => number::<Int64Type>(),
        DataType::UInt8 => number::<UInt8Type>(),
        DataType::UInt16 => number::<UInt16Type>(),
        DataType::UInt32 => number::<UInt32Type>(),
        DataType::UInt64 => number::<UInt64Type>(),
        DataType::Float16 => number::<Float16Type>(),
        DataType::Float32 => number::<Float32Type>(),
        DataType::Float64 => number::<Float64Type>(),
        DataType::Decimal32(..) => decimal::<Decimal32Type>(),
        DataType::Decimal64(..) => decimal::<Decimal64Type>(),
        DataType::Decimal128(..) => decimal::<Decimal128Type>(),
        DataType::Decimal256(..) => decimal::<Decimal256Type>(),
        // A column in which every value is missing.
        DataType::Null => Box::new(|_, _, _| {}),
        _ => return None,
    })
}

type Count = fn(&dyn Array, usize) -> i64;

/// How many of a column's times make a second, and how they are counted; `None` where it holds none.
fn times(found: &DataType) -> Option<(u64, Count)> {
    fn count<T: ArrowPrimitiveType>(array: &dyn Array, row: usize) -> i64
    where
        T::Native: Into<i64>,
    {
        array.as_primitive::<T>().value(row).into()
    }
    let (unit, count): (&TimeUnit, Count) = match found {
        DataType::Timestamp(unit, _) => (
            unit,
            match unit {
                TimeUnit::Second => count::<TimestampSecondType>,
                TimeUnit::Millisecond => count::<TimestampMillisecondType>,
                TimeUnit::Microsecond => count::<TimestampMicrosecondType>,
                TimeUnit::Nanosecond => count::<TimestampNanosecondType>,
            },
        ),
        DataType::Duration(unit) => (
            unit,
            match unit {
                TimeUnit::Second => count::<DurationSecondType>,
                TimeUnit::Millisecond => count::<DurationMillisecondType>,
                TimeUnit::Microsecond => count::<DurationMicrosecondType>,
                TimeUnit::Nanosecond => count::<DurationNanosecondType>,
            },
        ),
        DataType::Time32(unit @ TimeUnit::Second) => (unit, count::<Time32SecondType>),
        DataType::Time32(unit) => (unit, count::<Time32MillisecondType>),
        DataType::Time64(unit @ TimeUnit::Microsecond) => (unit, count::<Time64MicrosecondType>),
        DataType::Time64(unit) => (unit, count::<Time64NanosecondType>),
        _ => return None,
    };
    let per_second = match unit {
        TimeUnit::Second => 1,
        TimeUnit::Millisecond => 1_000,
        TimeUnit::Microsecond => 1_000_000,
        TimeUnit::Nanosecond => 1_000_000_000,
    };
    Some((per_second, count))
}
