//! Division of the text of a dataset's runs into cells, and the encoding of a file.

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

use super::document::Item;
use super::error::{DatasetError, FileProblem};
use super::keys::allow;
use super::keys::dataset::{DECIMAL, DELIMITER, ENCODING, SKIP_ROWS, THOUSANDS as MARK, UNITS_ROW};
use super::keys::rows::{COLUMN, KEYS, VALUE};
use super::keys::train_file::ROWS;

/// Marks of a number: before its fraction, and between groups of three digits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Marks {
    /// Before the fraction.
    pub decimal: u8,
    /// Between groups of three digits; `None` where there is no mark.
    pub thousands: Option<char>,
}

impl Marks {
    /// Returns the decimal mark without a mark between groups.
    pub const fn plain(decimal: u8) -> Self {
        Marks { decimal, thousands: None }
    }
}

/// Possible separators of groups of three digits.
pub const THOUSANDS: [char; 8] = ['.', ',', '\'', '’', ' ', '\u{a0}', '\u{202f}', '\u{2009}'];

/// How the text of the runs' files is divided into cells.
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

    /// Reads the keys of `[dataset]`; a missing key has its plain value.
    pub(super) fn from_section(section: &Item) -> Result<Self, DatasetError> {
        let units_row = section.truth(UNITS_ROW.name)?.unwrap_or(false);
        let mut layout = TextLayout { units_row, ..Self::PLAIN };
        let encoding = ENCODING.named(section, "encoding", by_name, USUAL)?;
        layout.encoding = encoding.unwrap_or(UTF_8);
        if let Some(mark) = DELIMITER.quoted(section)? {
            let refused = || DELIMITER.refused(section, format_args!("{mark:?}"));
            layout.delimiter = delimiter_of(mark).ok_or_else(refused)?;
        }
        if let Some(mark) = DECIMAL.quoted(section)? {
            let refused = || DECIMAL.refused(section, format_args!("{mark:?}"));
            layout.decimal = decimal_of(mark).ok_or_else(refused)?;
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
        match is_ambiguous(layout.delimiter, layout.decimal) {
            true => Err(section.key_out_of_range(DECIMAL.name, "\".\"", OTHER_DECIMAL)),
            false => Ok(layout),
        }
    }

    /// Returns the marks of its numbers.
    pub(super) fn marks(&self) -> Marks {
        Marks { decimal: self.decimal, thousands: self.thousands }
    }

    /// Lines above the first row of values.
    pub fn lines_above(&self) -> usize {
        self.skip_rows + 1 + usize::from(self.units_row)
    }
}

/// Expected decimal mark where the delimiter is the same.
pub const OTHER_DECIMAL: &str = "another mark than the delimiter";

/// Returns the separator of cells that a text states.
pub fn delimiter_of(text: &str) -> Option<u8> {
    match text.as_bytes() {
        &[mark] if mark.is_ascii() && !b"\"\r\n".contains(&mark) => Some(mark),
        _ => None,
    }
}

/// Returns the decimal mark that a text states.
pub fn decimal_of(text: &str) -> Option<u8> {
    match text {
        "." => Some(b'.'),
        "," => Some(b','),
        _ => None,
    }
}

/// Returns true for marks of which one would be taken for the other. A comma between the digits of a quoted cell
/// separates no cells.
pub fn is_ambiguous(delimiter: u8, decimal: u8) -> bool {
    delimiter == decimal && decimal != b','
}

/// Value of the key where all rows are of one train, even if a column names several.
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
    pub(super) fn from_train(train: &Item) -> Result<Self, DatasetError> {
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

/// The encodings that messages propose; every other of the WHATWG's list is known, too.
pub(super) const USUAL: [&str; 5] = ["utf-8", "windows-1252", "iso-8859-2", "utf-16le", "utf-16be"];

/// Returns the encoding of this name, as `utf-8`, `windows-1252`, `cp1252` or `latin1`.
pub fn by_name(name: &str) -> Option<&'static Encoding> {
    Encoding::for_label_no_replacement(name.as_bytes())
}

/// Returns the encoding of bytes that nobody described: UTF-16 by its first bytes, UTF-8 where the bytes are valid,
/// else that of Western European Windows, unless they hold bytes that no text has.
pub fn guessed(bytes: &[u8]) -> &'static Encoding {
    match bytes {
        [0xff, 0xfe, ..] => UTF_16LE,
        [0xfe, 0xff, ..] => UTF_16BE,
        _ if std::str::from_utf8(bytes).is_ok() || bytes.iter().any(is_no_letter) => UTF_8,
        _ => WINDOWS_1252,
    }
}

fn is_no_letter(byte: &u8) -> bool {
    byte.is_ascii_control() && !byte.is_ascii_whitespace()
}

/// Returns the text of a run's file in its declared encoding.
///
/// # Errors
///
/// If bytes are not valid in the encoding, with the line.
pub fn decoded(bytes: Vec<u8>, encoding: &'static Encoding) -> Result<String, FileProblem> {
    if encoding == UTF_8 {
        return String::from_utf8(bytes).map_err(|error| {
            let good = &error.as_bytes()[..error.utf8_error().valid_up_to()];
            let line = 1 + good.iter().filter(|&&byte| byte == b'\n').count();
            FileProblem::OtherEncoding { line, expected: encoding.name() }
        });
    }
    if let Some(text) = encoding.decode_without_bom_handling_and_without_replacement(&bytes) {
        return Ok(text.into_owned());
    }
    let (text, _) = encoding.decode_without_bom_handling(&bytes);
    Err(FileProblem::OtherEncoding { line: line_of_first_loss(&text), expected: encoding.name() })
}

/// Returns the line, from 1, of the first letter that replaces unreadable bytes.
fn line_of_first_loss(text: &str) -> usize {
    let good = text.split('\u{fffd}').next().unwrap_or_default();
    1 + good.matches('\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_letters_are_read_of_several_encodings() {
        let text = "Zeit;Außen [°C]\n";
        let cp1252 = b"Zeit;Au\xdfen [\xb0C]\n".to_vec();
        let utf16: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        for (bytes, name) in [
            (text.as_bytes().to_vec(), "UTF-8"),
            (cp1252.clone(), "cp1252"),
            (cp1252.clone(), "Latin1"),
            (utf16, "utf-16le"),
        ] {
            assert_eq!(decoded(bytes, by_name(name).unwrap()), Ok(text.into()), "{name}");
        }
        assert_eq!((guessed(text.as_bytes()), guessed(&cp1252)), (UTF_8, WINDOWS_1252));
        assert_eq!(guessed(b"\x7fELF\x01\xb0"), UTF_8, "a program is no text of Windows");
        assert_eq!(guessed(&[0xff, 0xfe, b'a', 0]), UTF_16LE);
        assert!(["", "utf-9", "replacement"].into_iter().all(|name| by_name(name).is_none()));
        assert!(USUAL.into_iter().all(|name| by_name(name).is_some()));
    }

    #[test]
    fn bytes_of_another_encoding_are_named_with_their_line() {
        let lost = |bytes: &[u8], name: &str| decoded(bytes.to_vec(), by_name(name).unwrap());
        let at = |line, expected| Err(FileProblem::OtherEncoding { line, expected });
        assert_eq!(lost(b"a\nb\xb0\n", "utf-8"), at(2, "UTF-8"));
        assert_eq!(lost(b"a\0\n\0\0\xd8\n\0", "utf-16le"), at(2, "UTF-16LE"));
    }
}
