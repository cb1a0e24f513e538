//! The key `rows` of `[train]`: which rows of files of several trains are meant.

use super::document::Item;
use super::error::DatasetError;

/// The key in `[train]`.
const KEY: &str = "rows";
/// Its value where all rows are of one train, whatever a column says.
const ALL: &str = "all";

/// The rows of the runs' files that are the train's.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum TrainRows {
    /// All, unless a column says that they are of several trains.
    #[default]
    Unsaid,
    /// All.
    All,
    /// Those with a value in a column.
    Of {
        /// The column's name.
        column: String,
        /// The cell of this train.
        value: String,
    },
}

impl TrainRows {
    /// Reads the key of `[train]`.
    pub(super) fn of(train: &Item) -> Result<Self, DatasetError> {
        if !train.has(KEY) {
            return Ok(TrainRows::Unsaid);
        }
        let expected = "\"all\", or { column = \"…\", value = \"…\" } of the rows of this train";
        if !train.need(KEY, expected)?.is_map() {
            return match train.need_quoted(KEY, expected)? {
                ALL => Ok(TrainRows::All),
                other => Err(train.key_out_of_range(KEY, &format!("{other:?}"), expected)),
            };
        }
        let section = train.need_table(KEY)?;
        section.allow(&["column", "value"])?;
        let text = |key, expected| Ok(section.need_quoted(key, expected)?.trim().to_owned());
        Ok(TrainRows::Of {
            column: text("column", "the name of a column")?,
            value: text("value", "the cell of this train's rows, quoted")?,
        })
    }
}
