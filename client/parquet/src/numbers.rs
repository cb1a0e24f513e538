//! A Parquet file of anybody as columns of numbers: all its columns by name, and what the wanted ones hold.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::Path;

use arrow_array::cast::AsArray;
use arrow_array::types::{
    Decimal32Type, Decimal64Type, Decimal128Type, Decimal256Type, DecimalType, Float16Type,
    Float32Type, Float64Type, Int32Type, Int64Type,
};
use arrow_array::{Array, downcast_integer, make_array, new_empty_array};
use arrow_schema::{DataType, TimeUnit};
use dynocar_dataset::RunColumn;
use dynocar_model::units::{Dimension, Unit};
use parquet::arrow::ProjectionMask;

use crate::error::{TableError, TableProblem};
use crate::guarded::guarded;
use crate::reading::open;

/// A column that is wanted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Its name.
    pub column: String,
    /// The unit in which its numbers are wanted, which a column of times is converted to.
    pub unit: String,
}

/// All columns of a file, with the numbers in the wanted ones: what is missing is `NaN`, true is 1 and false 0.
/// Where a wanted column is not there, none has numbers.
///
/// # Errors
///
/// When the file cannot be read, or a wanted column holds neither numbers nor truths nor times.
pub fn columns(path: &Path, wanted: &[Wanted]) -> Result<Vec<RunColumn>, TableError> {
    guarded(path, || read(path, wanted))
}

fn read(path: &Path, wanted: &[Wanted]) -> Result<Vec<RunColumn>, TableProblem> {
    let builder = open(path)?;
    let fields = builder.schema().fields().clone();
    let unread = fields.iter().map(|it| RunColumn { name: it.name().clone(), values: None });
    let mut columns: Vec<RunColumn> = unread.collect();
    let index = |it: &Wanted| {
        let mut found = (0..fields.len()).filter(|&index| *fields[index].name() == it.column);
        found.next().filter(|_| found.next().is_none())
    };
    let places = wanted.iter().map(|it| Some((index(it)?, it)));
    let Some(places) = places.collect::<Option<BTreeMap<usize, &Wanted>>>() else {
        return Ok(columns);
    };
    // What holds no numbers is refused without rows too.
    for (&index, wanted) in &places {
        let none = new_empty_array(fields[index].data_type());
        columns[index].values = Some(numbers(&none, wanted)?);
    }
    let mask = ProjectionMask::roots(builder.parquet_schema(), places.keys().copied());
    for batch in builder.with_projection(mask).build().map_err(TableProblem::not_parquet)? {
        let batch = batch.map_err(TableProblem::not_parquet)?;
        for ((&index, wanted), array) in places.iter().zip(batch.columns()) {
            columns[index].values.get_or_insert_default().extend(numbers(array, wanted)?);
        }
    }
    Ok(columns)
}

/// The numbers in an array.
fn numbers(array: &dyn Array, wanted: &Wanted) -> Result<Vec<f64>, TableProblem> {
    let found = array.data_type();
    let refuse = |expected| TableProblem::OtherType {
        column: wanted.column.clone(),
        expected,
        found: found.to_string(),
    };
    if let Some(per_second) = times_per_second(found) {
        let unit = Unit::find(Dimension::Time, &wanted.unit)
            .ok_or_else(|| refuse(format!("numbers in {}", wanted.unit)))?;
        return times(array, per_second, &unit);
    }
    macro_rules! integers {
        ($of:ty, $array:ident) => {
            each($array.as_primitive::<$of>(), |it| it as f64)
        };
    }
    Ok(downcast_integer! {
        found => (integers, array),
        DataType::Boolean => each(array.as_boolean(), |it| f64::from(u8::from(it))),
        DataType::Float64 => each(array.as_primitive::<Float64Type>(), |it| it),
        // As they are written: 0.1 is a tenth.
        DataType::Float32 => each(array.as_primitive::<Float32Type>(), as_written),
        DataType::Float16 => each(array.as_primitive::<Float16Type>(), as_written),
        DataType::Decimal32(..) => decimals::<Decimal32Type>(array),
        DataType::Decimal64(..) => decimals::<Decimal64Type>(array),
        DataType::Decimal128(..) => decimals::<Decimal128Type>(array),
        DataType::Decimal256(..) => decimals::<Decimal256Type>(array),
        // A column in which every value is missing.
        DataType::Null => vec![f64::NAN; array.len()],
        _ => return Err(refuse("numbers, true and false, or times".into()))
    })
}

fn each<T>(values: impl IntoIterator<Item = Option<T>>, number: impl Fn(T) -> f64) -> Vec<f64> {
    values.into_iter().map(|it| it.map_or(f64::NAN, &number)).collect()
}

/// The number whose shortest text this is.
fn as_written(number: impl Display) -> f64 {
    number.to_string().parse().unwrap_or(f64::NAN)
}

fn decimals<T: DecimalType>(array: &dyn Array) -> Vec<f64> {
    let decimals = array.as_primitive::<T>();
    let text = |row| decimals.is_valid(row).then(|| decimals.value_as_string(row));
    each((0..decimals.len()).map(text), as_written)
}

/// How many of a column's times make a second; `None` where it holds none.
fn times_per_second(found: &DataType) -> Option<u64> {
    let (DataType::Timestamp(unit, _)
    | DataType::Duration(unit)
    | DataType::Time32(unit)
    | DataType::Time64(unit)) = found
    else {
        return None;
    };
    Some(match unit {
        TimeUnit::Second => 1,
        TimeUnit::Millisecond => 1_000,
        TimeUnit::Microsecond => 1_000_000,
        TimeUnit::Nanosecond => 1_000_000_000,
    })
}

fn times(array: &dyn Array, per_second: u64, unit: &Unit) -> Result<Vec<f64>, TableProblem> {
    let is_short = matches!(array.data_type(), DataType::Time32(_));
    let counted_as = if is_short { DataType::Int32 } else { DataType::Int64 };
    let counts = array.to_data().into_builder().data_type(counted_as).build();
    let counts = make_array(counts.map_err(TableProblem::not_parquet)?);
    let seconds = Unit::base_of(Dimension::Time);
    let time = |count: i64| {
        let (sign, count) = (if count < 0 { "-" } else { "" }, count.unsigned_abs());
        let (whole, part) = (count / per_second, count % per_second);
        // By its text it is the nearest number.
        let time_s =
            as_written(format_args!("{sign}{whole}.{:09}", part * (1_000_000_000 / per_second)));
        if unit.name() == seconds.name() { time_s } else { seconds.convert(time_s, unit) }
    };
    Ok(match is_short {
        true => each(counts.as_primitive::<Int32Type>(), |it| time(it.into())),
        false => each(counts.as_primitive::<Int64Type>(), time),
    })
}
