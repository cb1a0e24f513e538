//! Parquet files of several trains.

use std::path::Path;

use arrow_array::cast::AsArray;
use arrow_array::{Array, downcast_integer_array};
use arrow_schema::DataType;
use dynocar_dataset::trains::{TrainCells, names_trains};
use parquet::arrow::ProjectionMask;

use crate::error::{TableError, TableProblem, guarded};
use crate::reading::open;

/// Refuses a file in which a column says that the rows are of several trains in turn.
///
/// # Errors
///
/// Names the trains; or when the file cannot be read.
pub fn require_one_train(path: &Path) -> Result<(), TableError> {
    guarded(path, || {
        let builder = open(path)?;
        let fields = builder.schema().fields().clone();
        let Some(index) = fields.iter().position(|it| names_trains(it.name())) else {
            return Ok(());
        };
        let mask = ProjectionMask::roots(builder.parquet_schema(), [index]);
        let batches = builder.with_projection(mask).build().map_err(TableProblem::not_parquet)?;
        let (mut cells, mut line) = (TrainCells::default(), 1);
        for batch in batches {
            for text in texts(batch.map_err(TableProblem::not_parquet)?.column(0)) {
                line += 1;
                cells.push(text.unwrap_or_default().trim(), line);
            }
        }
        match cells.column(fields[index].name().clone()).filter(|it| it.is_interleaved()) {
            Some(trains) => Err(TableProblem::SeveralTrains(trains.words())),
            None => Ok(()),
        }
    })
}

/// The cells of texts or whole numbers; none of others.
fn texts(array: &dyn Array) -> Vec<Option<String>> {
    fn owned<'a>(texts: impl Iterator<Item = Option<&'a str>>) -> Vec<Option<String>> {
        texts.map(|it| it.map(str::to_owned)).collect()
    }
    downcast_integer_array! {
        array => array.iter().map(|it| it.map(|it| it.to_string())).collect(),
        DataType::Utf8 => owned(array.as_string::<i32>().iter()),
        DataType::LargeUtf8 => owned(array.as_string::<i64>().iter()),
        DataType::Utf8View => owned(array.as_string_view().iter()),
        DataType::Dictionary(..) => {
            let dictionary = array.as_any_dictionary();
            let values = texts(dictionary.values());
            let keys = dictionary.normalized_keys().into_iter();
            keys.map(|key| values.get(key).cloned().flatten()).collect()
        }
        _ => Vec::new(),
    }
}
