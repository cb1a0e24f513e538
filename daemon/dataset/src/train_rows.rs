//! The key `rows` of `[train]`: which rows of files of several trains are meant.

use super::document::Item;
use super::error::DatasetError;
use super::keys::rows::{COLUMN, KEYS, VALUE};
use super::keys::{allow, train_file::ROWS};

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
        let (key, expected) = (ROWS.name, ROWS.rule.allowed);
        if !train.has(key) {
            return Ok(TrainRows::Unsaid);
        }
        if !train.need(key, expected)?.is_map() {
            return match ROWS.need_quoted(train)? {
                ALL => Ok(TrainRows::All),
                other => Err(ROWS.refused(train, format_args!("{other:?}"))),
            };
        }
        let section = train.need_table(key)?;
        allow(&section, KEYS)?;
        Ok(TrainRows::Of {
            column: COLUMN.need_quoted(&section)?.trim().into(),
            value: VALUE.need_quoted(&section)?.trim().into(),
        })
    }
}
