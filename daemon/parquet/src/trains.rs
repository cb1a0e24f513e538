//! Whose the rows of a Parquet file are.

use arrow_array::array::AnyDictionaryArray;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, downcast_integer_array};
use arrow_schema::DataType;
use dynocar_dataset::TrainColumn;
use dynocar_dataset::trains::names_trains;
use parquet::arrow::ProjectionMask;

use crate::error::TableProblem;
use crate::reading::Builder;

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
pub fn keys_of(dictionary: &dyn AnyDictionaryArray) -> impl Iterator<Item = Option<usize>> {
    let has_values = !dictionary.values().is_empty();
    let keys = if has_values { dictionary.normalized_keys() } else { Vec::new() };
    (0..dictionary.len())
        .map(move |row| keys.get(row).copied().filter(|_| dictionary.is_valid(row)))
}
