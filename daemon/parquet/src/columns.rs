//! A Parquet file of any program as columns of numbers: the names of all columns, the contents of the wanted ones, and
//! the train of each row.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs::File;
use std::path::Path;

use bytes::Bytes;
use dynocar_dataset::format::place_of;
use dynocar_dataset::text_layout::TrainRows;
use dynocar_dataset::trains::names_trains;
use dynocar_dataset::{ColumnMapping, RunColumn, RunColumns, TrainColumn};
use dynocar_model::units::{Dimension, Unit};
use half::f16;
use num_bigint::BigInt;
use parquet::data_type::FixedLenByteArray;

use crate::column_type::CellKind;
use crate::file::{ColumnReader, FileColumn, ParquetFile, TableProblem, damaged, guarded};

/// Returns all columns of a Parquet file, with the numbers in the mapped ones: a missing value is `NaN`, true is 1 and
/// false 0. Where a mapped column is not there, no column has numbers. The train of each row comes with them, where a
/// column names it.
///
/// # Errors
///
/// When the file cannot be read, or a mapped column holds neither numbers nor truths nor times.
pub fn columns_of(
    path: &Path,
    mappings: &[ColumnMapping],
    train_rows: &TrainRows,
) -> Result<RunColumns, TableProblem> {
    guarded(|| read(&ParquetFile::open(File::open(path)?)?, mappings, train_rows))
}

/// Returns the same of a file's bytes.
///
/// # Errors
///
/// As [`columns_of`].
pub fn columns_of_bytes(
    bytes: Vec<u8>,
    mappings: &[ColumnMapping],
    train_rows: &TrainRows,
) -> Result<RunColumns, TableProblem> {
    guarded(|| read(&ParquetFile::open(Bytes::from(bytes))?, mappings, train_rows))
}

fn read(
    file: &ParquetFile,
    mappings: &[ColumnMapping],
    train_rows: &TrainRows,
) -> Result<RunColumns, TableProblem> {
    let place = |(name, unit): (&String, Unit)| {
        let mut found = (0..file.columns.len()).filter(|&index| file.columns[index].name == *name);
        found.next().filter(|_| found.next().is_none()).map(|index| (index, unit))
    };
    let wanted = mappings.iter().flat_map(|it| it.names().map(|name| (name, it.unit)));
    let units: Option<BTreeMap<usize, Unit>> = wanted.map(place).collect();
    let units = units.unwrap_or_default();
    // A column without numbers is refused without rows too.
    for (&index, unit) in &units {
        require_numbers(&file.columns[index], unit)?;
    }
    let is_theirs = |it: &&FileColumn| match train_rows {
        TrainRows::All => false,
        TrainRows::Unsaid => names_trains(&it.name),
        TrainRows::Of { column, .. } => it.name.trim() == column,
    };
    let trains = file.columns.iter().find(is_theirs).map(|it| trains(file, it)).transpose()?;
    let columns = file.columns.iter().enumerate().map(|(index, column)| {
        let values = units.get(&index).map(|unit| numbers(file, column, unit)).transpose()?;
        Ok(RunColumn { name: column.name.clone(), values })
    });
    let columns = columns.collect::<Result<_, TableProblem>>()?;
    Ok(RunColumns { columns, trains: trains.flatten() })
}

/// Refuses a column that holds no numbers in a unit.
fn require_numbers(column: &FileColumn, unit: &Unit) -> Result<(), TableProblem> {
    match column.column_type.kind {
        CellKind::Text | CellKind::Other => {
            Err(column.refused("numbers, true and false, or times"))
        }
        CellKind::Time { .. } if unit.dimension() != Dimension::Time => {
            Err(column.refused(format!("numbers in {}", unit.name())))
        }
        _ => Ok(()),
    }
}

/// Returns a column's numbers.
fn numbers(file: &ParquetFile, column: &FileColumn, unit: &Unit) -> Result<Vec<f64>, TableProblem> {
    let mut values = Vec::new();
    // Bytes that do not fit now are asked for again as they come.
    let _ = values.try_reserve_exact(file.rows_reserved());
    let kind = column.column_type.kind;
    let is_signed = kind != CellKind::Integer { is_signed: false };
    let seconds = Unit::base_of(Dimension::Time);
    let of_count = |count: i64| match kind {
        CellKind::Decimal { scale } => decimal(count, scale),
        CellKind::Time { per_second } => seconds.convert(time_s(count, per_second), unit),
        _ if is_signed => count as f64,
        _ => count.cast_unsigned() as f64,
    };
    let of_short =
        |count: i32| of_count(if is_signed { count.into() } else { count.cast_unsigned().into() });
    let of_bytes = |bytes: &[u8]| match (kind, bytes) {
        (CellKind::Decimal { scale }, _) => decimal(BigInt::from_signed_bytes_be(bytes), scale),
        (_, &[low, high]) => as_written(f16::from_le_bytes([low, high])),
        _ => f64::NAN,
    };
    file.read(column, |part| {
        let cells = part.cells;
        macro_rules! each {
            ($reader:expr, $number:expr) => {
                cells.each($reader, |it| values.push(it.map_or(f64::NAN, $number)))
            };
        }
        match part.reader {
            ColumnReader::BoolColumnReader(it) => each!(it, |it| f64::from(u8::from(*it))),
            ColumnReader::Int32ColumnReader(it) => each!(it, |it| of_short(*it)),
            ColumnReader::Int64ColumnReader(it) => each!(it, |it| of_count(*it)),
            ColumnReader::Int96ColumnReader(it) => each!(it, |it| of_count(it.to_nanos())),
            // As they are written: 0.1 is a tenth.
            ColumnReader::FloatColumnReader(it) => each!(it, as_written),
            ColumnReader::DoubleColumnReader(it) => each!(it, |it| *it),
            ColumnReader::ByteArrayColumnReader(it) => each!(it, |it| of_bytes(it.data())),
            ColumnReader::FixedLenByteArrayColumnReader(it) => {
                each!(it, |it: &FixedLenByteArray| of_bytes(it.data()))
            }
        }
    })?;
    Ok(values)
}

/// Returns the number whose shortest text this is.
fn as_written(number: impl Display) -> f64 {
    number.to_string().parse().unwrap_or(f64::NAN)
}

fn decimal(count: impl Display, scale: i32) -> f64 {
    as_written(format_args!("{count}e{}", -i64::from(scale)))
}

/// Returns a time in s; by its text it is the nearest number.
fn time_s(count: i64, per_second: u64) -> f64 {
    let (sign, count) = (if count < 0 { "-" } else { "" }, count.unsigned_abs());
    let (whole, part) = (count / per_second, count % per_second);
    as_written(format_args!("{sign}{whole}.{:09}", part * (1_000_000_000 / per_second)))
}

/// Whose the rows are, by a column of texts or numbers; `None` where it holds others.
fn trains(file: &ParquetFile, column: &FileColumn) -> Result<Option<TrainColumn>, TableProblem> {
    let TrainColumn { mut trains, mut rows, .. } = TrainColumn::default();
    let mut place = |cell: &str| {
        let cell = cell.trim();
        if cell.is_empty() {
            return f64::NAN;
        }
        place_of(cell, &mut trains) as f64
    };
    let mut is_text = true;
    let is_signed = column.is(CellKind::Integer { is_signed: true });
    match column.column_type.kind {
        CellKind::Text | CellKind::Integer { .. } => {}
        // Whole numbers of which some are missing are such numbers to pandas.
        CellKind::Float if column.column_type.words == "Float64" => {}
        _ => return Ok(None),
    }
    file.read(column, |part| {
        let cells = part.cells;
        macro_rules! each {
            ($reader:expr, $cell:expr) => {
                cells.each($reader, |it| rows.push(it.map_or(f64::NAN, $cell)))
            };
        }
        match part.reader {
            ColumnReader::Int32ColumnReader(it) if is_signed => {
                each!(it, |it| place(&it.to_string()))
            }
            ColumnReader::Int32ColumnReader(it) => {
                each!(it, |it| place(&it.cast_unsigned().to_string()))
            }
            ColumnReader::Int64ColumnReader(it) if is_signed => {
                each!(it, |it| place(&it.to_string()))
            }
            ColumnReader::Int64ColumnReader(it) => {
                each!(it, |it| place(&it.cast_unsigned().to_string()))
            }
            ColumnReader::DoubleColumnReader(it) => {
                each!(it, |it| if it.is_nan() { *it } else { place(&it.to_string()) })
            }
            ColumnReader::ByteArrayColumnReader(it) => each!(it, |it| {
                it.as_utf8().map_or_else(|_| (is_text = false, f64::NAN).1, &mut place)
            }),
            _ => Ok(()),
        }
    })?;
    let name = column.name.trim().to_owned();
    if is_text { Ok(Some(TrainColumn { name, trains, rows })) } else { Err(damaged("not UTF-8")) }
}
