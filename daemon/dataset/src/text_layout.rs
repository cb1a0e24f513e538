//! How the text of a dataset's runs falls into cells.

use encoding_rs::{Encoding, UTF_8};

use super::document::Section;
use super::encoding;
use super::error::DatasetError;

/// More lines above the names than any recorder writes.
const SKIP_ROWS_MAX: f64 = 10_000.0;

/// How the text of the runs' files falls into cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextLayout {
    /// Which letters the bytes are.
    pub encoding: &'static Encoding,
    /// What separates the cells of a row.
    pub delimiter: u8,
    /// What separates a number's fraction: a point or a comma.
    pub decimal: u8,
    /// Lines above that with the columns' names.
    pub skip_rows: usize,
    /// True where a line of units stands below the names.
    pub units_row: bool,
}

impl TextLayout {
    /// The keys that declare it, in `[dataset]`.
    pub const KEYS: [&str; 5] = ["encoding", "delimiter", "decimal", "skip_rows", "units_row"];

    /// CSV as programs write it: names, then rows, with commas between the cells and points in numbers.
    pub const PLAIN: TextLayout = TextLayout {
        encoding: UTF_8,
        delimiter: b',',
        decimal: b'.',
        skip_rows: 0,
        units_row: false,
    };

    /// Reads the keys of `[dataset]`; what is left out is plain.
    pub(super) fn of(section: &Section) -> Result<Self, DatasetError> {
        let layout = TextLayout {
            encoding: encoding_of(section)?,
            delimiter: delimiter(section)?,
            decimal: decimal(section)?,
            skip_rows: skip_rows(section)?,
            units_row: section.truth("units_row")?.unwrap_or(false),
        };
        // A comma between the digits of a quoted cell separates no cells.
        if layout.delimiter == layout.decimal && layout.decimal != b',' {
            let shown = format!("{:?}", char::from(layout.decimal).to_string());
            return Err(section.out_of_range("decimal", &shown, "another mark than the delimiter"));
        }
        Ok(layout)
    }

    /// Lines above the first row of values.
    pub fn lines_above(&self) -> usize {
        self.skip_rows + 1 + usize::from(self.units_row)
    }
}

fn encoding_of(section: &Section) -> Result<&'static Encoding, DatasetError> {
    const KEY: &str = "encoding";
    let Some(name) = section.text(KEY)? else { return Ok(UTF_8) };
    encoding::by_name(name).ok_or_else(|| section.unknown(KEY, KEY, name, &encoding::USUAL))
}

fn delimiter(section: &Section) -> Result<u8, DatasetError> {
    const KEY: &str = "delimiter";
    match section.text(KEY)?.map(str::as_bytes) {
        None => Ok(b','),
        Some(&[mark]) if mark.is_ascii() && !b"\"\r\n".contains(&mark) => Ok(mark),
        Some(other) => {
            let shown = format!("{:?}", String::from_utf8_lossy(other));
            Err(section.out_of_range(KEY, &shown, "one ASCII character, as \",\" \";\" or \"\\t\""))
        }
    }
}

fn decimal(section: &Section) -> Result<u8, DatasetError> {
    match section.text("decimal")? {
        None | Some(".") => Ok(b'.'),
        Some(",") => Ok(b','),
        Some(other) => {
            Err(section.out_of_range("decimal", &format!("{other:?}"), "\".\" or \",\""))
        }
    }
}

fn skip_rows(section: &Section) -> Result<usize, DatasetError> {
    let allowed = "a number of lines, 0 to 10000";
    let is_allowed = |count: f64| (0.0..=SKIP_ROWS_MAX).contains(&count) && count.fract() == 0.0;
    Ok(section.number("skip_rows", allowed, is_allowed)?.unwrap_or(0.0) as usize)
}
