//! A Parquet file of anybody as columns of numbers: all its columns by name, what the wanted ones hold, and whose the
//! rows are.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::io::{self, Write};
use std::path::Path;

use arrow_array::array::AnyDictionaryArray;
use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Decimal32Type, Decimal64Type, Decimal128Type, Decimal256Type, DecimalType,
    Float16Type, Float32Type, Float64Type, Int32Type, Int64Type,
};
use arrow_array::{
    Array, PrimitiveArray, downcast_integer, downcast_integer_array, make_array, new_empty_array,
};
use arrow_schema::{DataType, TimeUnit};
use dynocar::columns_stream::{Header, Sender};
use dynocar_dataset::TrainColumn;
use dynocar_dataset::trains::names_trains;
use dynocar_model::units::{Dimension, Unit};
use parquet::arrow::ProjectionMask;

use super::error::guarded;
use crate::error::{TableError, TableProblem};
use crate::reading::{Builder, open};

/// A column that is wanted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Its name.
    pub column: String,
    /// The unit in which its numbers are wanted, which a column of times is converted to.
    pub unit: String,
}

/// Rows decoded at once: enough that little is done for each batch, and few enough that a column's numbers stay in
/// the processor's memory until they are on their way.
const BATCH_ROWS: usize = 8192;

/// Hands over all columns of a file, with the numbers in the wanted ones, batch after batch: what is missing is
/// `NaN`, true is 1 and false 0. Where a wanted column is not there, none has numbers. Beside them come the trains,
/// where a column says whose the rows are.
///
/// # Errors
///
/// When the file cannot be read, or a wanted column holds neither numbers nor truths nor times; within, when the
/// other side does not take them.
pub fn send_columns(
    path: &Path,
    wanted: &[Wanted],
    trains: Option<&TrainsBy>,
    output: impl Write,
) -> Result<io::Result<()>, TableError> {
    guarded(path, || {
        let mut sender = None;
        let sent = send(path, (wanted, trains), output, &mut sender);
        // An error is reported behind the columns.
        let ended = sender.map_or(Ok(()), Sender::end);
        sent.map(|it| it.and(ended))
    })
}

/// Leaves the sender in its place once it has begun.
fn send<W: Write>(
    path: &Path,
    (wanted, trains): (&[Wanted], Option<&TrainsBy>),
    output: W,
    sender: &mut Option<Sender<W>>,
) -> Result<io::Result<()>, TableProblem> {
    let builder = open(path)?;
    let fields = builder.schema().fields().clone();
    let index = |it: &Wanted| {
        let mut found = (0..fields.len()).filter(|&index| *fields[index].name() == it.column);
        found.next().filter(|_| found.next().is_none())
    };
    let places = wanted.iter().map(|it| Some((index(it)?, it)));
    let places: BTreeMap<usize, &Wanted> = places.collect::<Option<_>>().unwrap_or_default();
    // A column without numbers is refused without rows too.
    for (&index, wanted) in &places {
        numbers(&new_empty_array(fields[index].data_type()), wanted)?;
    }
    let rows = builder.metadata().file_metadata().num_rows().try_into().unwrap_or(0);
    let columns = fields.iter().enumerate();
    let columns = columns.map(|(index, it)| (it.name().clone(), places.contains_key(&index)));
    let columns = columns.collect();
    let trains = trains.map(|it| it.read(open(path)?)).transpose()?.flatten();
    let (trains, rows_trains) = trains.map(|it| ((it.name, it.trains), it.rows)).unzip();
    let sender = match Sender::begin(&Header { rows, columns, trains }, output) {
        Ok(it) => sender.insert(it),
        Err(error) => return Ok(Err(error)),
    };
    if places.is_empty() {
        return Ok(rows_trains.map_or(Ok(()), |it| sender.rows(&[it])));
    }
    let mut rows_trains = rows_trains.as_deref();
    let mask = ProjectionMask::roots(builder.parquet_schema(), places.keys().copied());
    let batches = builder.with_projection(mask).with_batch_size(BATCH_ROWS).build();
    for batch in batches.map_err(TableProblem::not_parquet)? {
        let batch = batch.map_err(TableProblem::not_parquet)?;
        let arrays = places.values().zip(batch.columns());
        let mut block: Vec<Vec<f64>> =
            arrays.map(|(wanted, array)| numbers(array, wanted)).collect::<Result<_, _>>()?;
        block.extend(
            rows_trains.as_mut().and_then(|it| it.split_off(..batch.num_rows())).map(Vec::from),
        );
        if let Err(error) = sender.rows(&block) {
            return Ok(Err(error));
        }
    }
    Ok(Ok(()))
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
            primitives($array.as_primitive::<$of>(), |it| it as f64)
        };
    }
    Ok(downcast_integer! {
        found => (integers, array),
        DataType::Boolean => each(array.as_boolean(), |it| f64::from(u8::from(it))),
        DataType::Float64 => primitives(array.as_primitive::<Float64Type>(), |it| it),
        // As they are written: 0.1 is a tenth.
        DataType::Float32 => primitives(array.as_primitive::<Float32Type>(), as_written),
        DataType::Float16 => primitives(array.as_primitive::<Float16Type>(), as_written),
        DataType::Decimal32(..) => decimals::<Decimal32Type>(array),
        DataType::Decimal64(..) => decimals::<Decimal64Type>(array),
        DataType::Decimal128(..) => decimals::<Decimal128Type>(array),
        DataType::Decimal256(..) => decimals::<Decimal256Type>(array),
        // Numbers that repeat, as categories.
        DataType::Dictionary(..) => {
            let dictionary = array.as_any_dictionary();
            let values = numbers(dictionary.values(), wanted)?;
            keys_of(dictionary).map(|key| key.map_or(f64::NAN, |key| values[key])).collect()
        }
        // A column in which every value is missing.
        DataType::Null => vec![f64::NAN; array.len()],
        _ => return Err(refuse("numbers, true and false, or times".into()))
    })
}

fn each<T>(values: impl IntoIterator<Item = Option<T>>, number: impl Fn(T) -> f64) -> Vec<f64> {
    values.into_iter().map(|it| it.map_or(f64::NAN, &number)).collect()
}

fn primitives<T: ArrowPrimitiveType>(
    array: &PrimitiveArray<T>,
    number: impl Fn(T::Native) -> f64,
) -> Vec<f64> {
    match array.null_count() {
        0 => array.values().iter().map(|&it| number(it)).collect(),
        _ => each(array, number),
    }
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
        true => primitives(counts.as_primitive::<Int32Type>(), |it| time(it.into())),
        false => primitives(counts.as_primitive::<Int64Type>(), time),
    })
}

/// Which column says whose the rows are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TrainsBy {
    /// The first whose name says that it does.
    AnyName,
    /// The one of this name.
    Name(String),
}

impl TrainsBy {
    /// Reads the column; `None` where there is none of texts or numbers.
    ///
    /// # Errors
    ///
    /// When the file cannot be read.
    pub fn read(&self, builder: Builder) -> Result<Option<TrainColumn>, TableProblem> {
        let fields = builder.schema().fields().clone();
        let is_it = |name: &str| match self {
            TrainsBy::AnyName => names_trains(name),
            TrainsBy::Name(own) => name.trim() == own,
        };
        let Some(index) = fields.iter().position(|it| is_it(it.name())) else { return Ok(None) };
        let name = fields[index].name().trim().to_owned();
        let mut column = TrainColumn { name, ..TrainColumn::default() };
        let mask = ProjectionMask::roots(builder.parquet_schema(), [index]);
        let batches = builder.with_projection(mask).build().map_err(TableProblem::not_parquet)?;
        for batch in batches {
            let batch = batch.map_err(TableProblem::not_parquet)?;
            let Some(texts) = texts(batch.column(0)) else { return Ok(None) };
            column.rows.extend(texts.into_iter().map(|text| place(&mut column.trains, text)));
        }
        Ok(Some(column))
    }
}

/// The place of a cell's train among the names, where a new one is added; `NaN` for an empty cell.
fn place(trains: &mut Vec<String>, cell: Option<String>) -> f64 {
    let cell = cell.unwrap_or_default();
    let cell = cell.trim();
    if cell.is_empty() {
        return f64::NAN;
    }
    let known = trains.iter().position(|it| it == cell);
    let place = known.unwrap_or_else(|| {
        trains.push(cell.to_owned());
        trains.len() - 1
    });
    place as f64
}

/// The cells of texts or numbers; `None` of others.
fn texts(array: &dyn Array) -> Option<Vec<Option<String>>> {
    fn owned<'a>(texts: impl Iterator<Item = Option<&'a str>>) -> Option<Vec<Option<String>>> {
        Some(texts.map(|it| it.map(str::to_owned)).collect())
    }
    downcast_integer_array! {
        array => Some(array.iter().map(|it| it.map(|it| it.to_string())).collect()),
        // Whole numbers of which some are missing are such numbers to pandas.
        DataType::Float64 => {
            let numbers = array.as_primitive::<Float64Type>().iter();
            let text = |it: f64| (!it.is_nan()).then(|| it.to_string());
            Some(numbers.map(|it| it.and_then(text)).collect())
        }
        DataType::Utf8 => owned(array.as_string::<i32>().iter()),
        DataType::LargeUtf8 => owned(array.as_string::<i64>().iter()),
        DataType::Utf8View => owned(array.as_string_view().iter()),
        DataType::Dictionary(..) => {
            let dictionary = array.as_any_dictionary();
            let values = texts(dictionary.values())?;
            Some(keys_of(dictionary).map(|key| key.and_then(|key| values[key].clone())).collect())
        }
        _ => None,
    }
}

/// The place of each row's value among a dictionary's.
fn keys_of(dictionary: &dyn AnyDictionaryArray) -> impl Iterator<Item = Option<usize>> {
    let has_values = !dictionary.values().is_empty();
    let keys = if has_values { dictionary.normalized_keys() } else { Vec::new() };
    (0..dictionary.len())
        .map(move |row| keys.get(row).copied().filter(|_| dictionary.is_valid(row)))
}
