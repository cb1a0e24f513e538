//! How the text of a dataset's runs falls into cells.

use encoding_rs::{Encoding, UTF_8};

use super::document::Item;
use super::encoding;
use super::error::DatasetError;
use super::keys::allow;
use super::keys::dataset::{DECIMAL, DELIMITER, ENCODING, SKIP_ROWS, THOUSANDS as MARK, UNITS_ROW};
use super::keys::rows::{COLUMN, KEYS, VALUE};
use super::keys::train_file::ROWS;

/// Marks of a number: before its fraction, and between groups of three digits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Marks {
    /// Before the fraction.
    pub decimal: u8,
    /// Between groups of three digits; `None` where nothing is.
    pub thousands: Option<char>,
}

impl Marks {
    /// A point and nothing, or a comma and nothing.
    pub const fn plain(decimal: u8) -> Self {
        Marks { decimal, thousands: None }
    }
}

/// Possible separators of groups of three digits.
pub const THOUSANDS: [char; 8] = ['.', ',', '\'', '’', ' ', '\u{a0}', '\u{202f}', '\u{2009}'];

/// How the text of the runs' files falls into cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextLayout {
    /// Which letters the bytes are.
    pub encoding: &'static Encoding,
    /// Separator of the cells of a row.
    pub delimiter: u8,
    /// Separator of a number's fraction: a point or a comma.
    pub decimal: u8,
    /// Separator of groups of three digits in numbers; `None` without one.
    pub thousands: Option<char>,
    /// Lines above that with the columns' names.
    pub skip_rows: usize,
    /// True where a line of units stands below the names.
    pub units_row: bool,
}

impl TextLayout {
    /// CSV as programs write it: names, then rows, with commas between the cells and points in numbers.
    pub const PLAIN: TextLayout = TextLayout {
        encoding: UTF_8,
        delimiter: b',',
        decimal: b'.',
        thousands: None,
        skip_rows: 0,
        units_row: false,
    };

    /// Reads the keys of `[dataset]`; what is left out is plain.
    pub(super) fn of(section: &Item) -> Result<Self, DatasetError> {
        let units_row = section.truth(UNITS_ROW.name)?.unwrap_or(false);
        let mut layout = TextLayout { units_row, ..Self::PLAIN };
        let encoding = ENCODING.named(section, "encoding", encoding::by_name, encoding::USUAL)?;
        layout.encoding = encoding.unwrap_or(UTF_8);
        if let Some(mark) = DELIMITER.quoted(section)? {
            layout.delimiter = match mark.as_bytes() {
                &[mark] if mark.is_ascii() && !b"\"\r\n".contains(&mark) => mark,
                _ => return Err(DELIMITER.refused(section, format_args!("{mark:?}"))),
            };
        }
        if let Some(mark) = DECIMAL.quoted(section)? {
            layout.decimal = match mark {
                "." => b'.',
                "," => b',',
                _ => return Err(DECIMAL.refused(section, format_args!("{mark:?}"))),
            };
        }
        if let Some(text) = MARK.quoted(section)? {
            let mark =
                Some(text).filter(|it| it.chars().count() == 1).and_then(|it| it.chars().next());
            let is_other =
                |mark: &char| *mark != char::from(layout.decimal) && THOUSANDS.contains(mark);
            let refused = || MARK.refused(section, format_args!("{text:?}"));
            layout.thousands = Some(mark.filter(is_other).ok_or_else(refused)?);
        }
        layout.skip_rows = SKIP_ROWS.number(section)?.unwrap_or(0.0) as usize;
        // A comma between the digits of a quoted cell separates no cells.
        if layout.delimiter == layout.decimal && layout.decimal != b',' {
            let allowed = "another mark than the delimiter";
            return Err(section.key_out_of_range(DECIMAL.name, "\".\"", allowed));
        }
        Ok(layout)
    }

    /// The marks of its numbers.
    pub(super) fn marks(&self) -> Marks {
        Marks { decimal: self.decimal, thousands: self.thousands }
    }

    /// Lines above the first row of values.
    pub fn lines_above(&self) -> usize {
        self.skip_rows + 1 + usize::from(self.units_row)
    }
}

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
