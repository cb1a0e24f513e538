//! Lines of a CSV file, those above the names and the rows; numbers as most recorders write them.

use std::borrow::Cow;

use super::cell::lossy;
use super::error::{DatasetError, RENAME, SourcePosition, unknown};
use super::keys::dataset::SKIP_ROWS;
use super::manifest::ColumnMapping;
use super::text_layout::TextLayout;

/// A cell of a row.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell<'t> {
    /// Text of the cell, without quotes around it.
    pub text: Cow<'t, [u8]>,
    /// Its number, if it is written plainly.
    pub plain: Option<f64>,
}

/// A row of cells; never blank.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellRow<'t> {
    /// The cells.
    pub cells: Vec<Cell<'t>>,
    /// The line of the text, from 1, in which it begins.
    pub line: usize,
}

impl CellRow<'_> {
    /// Returns the text of a cell, trimmed of spaces; empty beyond the last one.
    pub fn trimmed(&self, index: usize) -> &[u8] {
        self.cells.get(index).map_or(b"", |cell| cell.text.trim_ascii())
    }
}

/// Reads the rows of a text, one after the other.
///
/// A line ends with `\n`, `\r` or both. Within quotes all marks are text, and two quotes stand for one; text after the
/// closing quote belongs to the cell, too.
#[derive(Clone, Debug)]
pub struct RowReader<'t> {
    /// Text that is not read yet.
    rest: &'t [u8],
    line: usize,
    delimiter: u8,
    decimal: u8,
    /// False where the delimiter may stand in a number.
    has_plain: bool,
}

impl<'t> RowReader<'t> {
    /// Returns a reader of a text's rows with these marks between cells and within numbers.
    pub fn new(text: &'t str, delimiter: u8, decimal: u8) -> Self {
        let rest = text.strip_prefix('\u{feff}').unwrap_or(text).as_bytes();
        let has_plain = delimiter != decimal && !b"0123456789+-".contains(&delimiter);
        RowReader { rest, line: 1, delimiter, decimal, has_plain }
    }

    /// Returns the bytes that are not read yet.
    pub fn bytes_left(&self) -> usize {
        self.rest.len()
    }

    /// Reads the next row; false where there is none.
    pub fn read(&mut self, row: &mut CellRow<'t>) -> bool {
        row.cells.clear();
        while let [mark @ (b'\n' | b'\r'), rest @ ..] = self.rest {
            self.line += usize::from(*mark == b'\n');
            self.rest = rest;
        }
        row.line = self.line;
        if self.rest.is_empty() {
            return false;
        }
        loop {
            row.cells.push(self.cell());
            match self.rest {
                [mark, rest @ ..] if *mark == self.delimiter => self.rest = rest,
                _ => return true,
            }
        }
    }

    /// Reads up to the end of a cell.
    #[inline]
    fn cell(&mut self) -> Cell<'t> {
        if self.rest.first() == Some(&b'"') {
            return self.quoted_cell();
        }
        let (length, plain) = match self.has_plain {
            true => plain_number(self.rest, self.decimal),
            false => (0, None),
        };
        let end = self.end_from(length);
        let (text, rest) = self.rest.split_at(end);
        self.rest = rest;
        Cell { text: Cow::Borrowed(text), plain: plain.filter(|_| end == length) }
    }

    fn quoted_cell(&mut self) -> Cell<'t> {
        let all = self.rest;
        let quote_from = |from: usize| {
            all[from..].iter().position(|byte| *byte == b'"').map_or(all.len(), |it| from + it)
        };
        let mut close = quote_from(1);
        let mut text = Cow::Borrowed(&all[1..close]);
        while all.get(close + 1) == Some(&b'"') {
            let next = quote_from(close + 2);
            text.to_mut().extend_from_slice(&all[close + 1..next]);
            close = next;
        }
        let behind = all.len().min(close + 1);
        let end = self.end_from(behind);
        if end > behind {
            text.to_mut().extend_from_slice(&all[behind..end]);
        }
        self.line += all[..end].iter().filter(|byte| **byte == b'\n').count();
        self.rest = &all[end..];
        Cell { text, plain: None }
    }

    /// Returns where the next delimiter or end of the line stands.
    #[inline]
    fn end_from(&self, from: usize) -> usize {
        let is_end = |byte: &u8| *byte == self.delimiter || matches!(byte, b'\n' | b'\r');
        self.rest[from..].iter().position(is_end).map_or(self.rest.len(), |it| from + it)
    }
}

/// Returns a text without its byte-order mark and the lines above the names.
pub fn below<'t>(label: &str, text: &'t str, skip_rows: usize) -> Result<&'t str, DatasetError> {
    let mut rest = text.strip_prefix('\u{feff}').unwrap_or(text);
    for lines in 0..skip_rows {
        let Some(end) = rest.find(['\n', '\r']) else {
            let lines = lines + usize::from(!rest.is_empty());
            return Err(SourcePosition::whole(label).problem(format!(
                "skip_rows = {skip_rows}: expected lines above the names, but the file has {lines} \
                 lines"
            )));
        };
        let is_pair = rest[end..].starts_with("\r\n");
        rest = &rest[end + 1 + usize::from(is_pair)..];
    }
    Ok(rest)
}

/// The powers of ten that a double holds exactly and a fraction of digits may need.
const POWERS_OF_TEN: [f64; 20] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19,
];
/// The greatest whole number below which a double holds them all.
const EXACT_MAX: u64 = 1 << 53;

/// Returns how many bytes of a text are a sign, digits and a decimal mark, and the number that they write; `None`
/// where they write none, or one that takes more than a division to round as [`f64::from_str`] does.
///
/// Both the digits as a whole number and the power of ten below it are exact, so that the one
/// division rounds once, to the nearest double.
///
/// [`f64::from_str`]: std::str::FromStr
#[inline]
pub(super) fn plain_number(text: &[u8], decimal: u8) -> (usize, Option<f64>) {
    let is_negative = text.first() == Some(&b'-');
    let signed = usize::from(is_negative || text.first() == Some(&b'+'));
    let (mut at, mut mantissa) = (signed, 0_u64);
    let mut digits = |mut at: usize| {
        while let Some(digit) =
            text.get(at).map(|byte| byte.wrapping_sub(b'0')).filter(|it| *it < 10)
        {
            // Of more digits than it holds, which are counted below, it is not used.
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
            at += 1;
        }
        at
    };
    at = digits(at);
    let (mut count, mut decimals) = (at - signed, 0);
    if text.get(at) == Some(&decimal) {
        let from = at + 1;
        at = digits(from);
        decimals = at - from;
        count += decimals;
    }
    if count == 0 || count >= POWERS_OF_TEN.len() || mantissa > EXACT_MAX {
        return (at, None);
    }
    let size = mantissa as f64 / POWERS_OF_TEN[decimals];
    (at, Some(if is_negative { -size } else { size }))
}

/// Number of lines that are searched for names that stand elsewhere than declared.
const LINES_MAX: usize = 100;

/// In which line the names stand instead, where that is found.
fn elsewhere(text: &str, (layout, mappings): (&TextLayout, &[ColumnMapping])) -> String {
    let holds_names = |line: &str| {
        let mut row = CellRow::default();
        let is_read = RowReader::new(line, layout.delimiter, layout.decimal).read(&mut row);
        let cells = names_of(&row);
        is_read && mappings.iter().flat_map(ColumnMapping::names).all(|name| cells.contains(name))
    };
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let found = text.lines().take(LINES_MAX).position(holds_names);
    found.map_or_else(String::new, |above| {
        format!("; the names stand in line {}: {}", above + 1, SKIP_ROWS.advice(above))
    })
}

/// Returns the names in a row, without spaces around them.
pub fn names_of(row: &CellRow) -> Vec<String> {
    row.cells.iter().map(|cell| lossy(&cell.text).trim().to_owned()).collect()
}

/// Returns the indices of every mapping's columns among the names of a text in this layout; or the error in the names.
pub fn find_columns(
    header: &[String],
    text: &str,
    (layout, mappings): (&TextLayout, &[ColumnMapping]),
) -> Result<Vec<Vec<usize>>, String> {
    let index = |mapping: &ColumnMapping, name: &String| {
        let mut found = (0..header.len()).filter(|&index| header[index] == *name);
        match (found.next(), found.count()) {
            (Some(index), 0) => Ok(index),
            (Some(_), more) => {
                Err(format!("column '{name}' occurs {} times in the header{RENAME}", 1 + more))
            }
            (None, _) => {
                let other =
                    [';', ',', '\t', '|'].into_iter().find(|mark| header[0].contains(*mark));
                if let (1, Some(other)) = (header.len(), other) {
                    return Err(format!(
                        "expected columns separated by {:?}, found {other:?} in the header: set \
                         delimiter = \"{}\" in [dataset]",
                        char::from(layout.delimiter),
                        other.escape_default()
                    ));
                }
                let instead = elsewhere(text, (layout, mappings));
                let context = format!(" (for {} in {}{instead})", mapping.quantity, mapping.place);
                let named = header.iter().filter(|other| !other.is_empty());
                Err(unknown("column", name, &context, named.cloned()))
            }
        }
    };
    let indices = |mapping: &ColumnMapping| {
        mapping.names().map(|name| index(mapping, name)).collect::<Result<Vec<usize>, String>>()
    };
    mappings.iter().map(indices).collect()
}

#[cfg(test)]
mod tests {
    use csv::{ByteRecord, ReaderBuilder};
    use proptest::prelude::*;

    use super::*;

    /// Returns the rows of a text, with their lines.
    fn rows(text: &str, delimiter: u8) -> Vec<(usize, Vec<String>)> {
        let (mut reader, mut row) = (RowReader::new(text, delimiter, b'.'), CellRow::default());
        let mut rows = Vec::new();
        while reader.read(&mut row) {
            let cells = row.cells.iter();
            let cells = cells.map(|cell| String::from_utf8(cell.text.to_vec()).unwrap());
            rows.push((row.line, cells.collect()));
        }
        rows
    }

    /// Returns the same by the crate `csv`, whose reader stands at the end of the line before, or before blank lines.
    fn rows_of_csv(text: &str, delimiter: u8) -> Vec<(usize, Vec<String>)> {
        let mut builder = ReaderBuilder::new();
        builder.delimiter(delimiter).has_headers(false).flexible(true);
        let mut reader = builder.from_reader(text.as_bytes());
        let (mut record, mut rows) = (ByteRecord::new(), Vec::new());
        while reader.read_byte_record(&mut record).unwrap() {
            let position = record.position().unwrap();
            let rest = &text.as_bytes()[position.byte() as usize..];
            let ends = rest.iter().take_while(|byte| b"\r\n".contains(byte));
            let line = position.line() as usize + ends.filter(|byte| **byte == b'\n').count();
            let cells = record.iter().map(|cell| String::from_utf8(cell.to_vec()).unwrap());
            rows.push((line, cells.collect()));
        }
        rows
    }

    proptest! {
        #[test]
        fn rows_are_those_of_the_crate_for_csv(
            text in "([-0-9.]{0,4}|[\"]{0,3}|[,;\r\n]|[ aä\"]{0,2}){0,40}",
            delimiter in prop::sample::select(&b",;-1"[..]),
        ) {
            prop_assert_eq!(rows(&text, delimiter), rows_of_csv(&text, delimiter), "{:?}", text);
        }
    }

    #[test]
    fn quotes_hold_delimiters_ends_of_lines_and_quotes() {
        let cells = |text| rows(text, b',').remove(0).1;
        assert_eq!(cells("\"a,b\",\"c\nd\",e\n"), ["a,b", "c\nd", "e"]);
        assert_eq!(cells("\"say \"\"no\"\"\",\"\",x\"y\n"), ["say \"no\"", "", "x\"y"]);
        assert_eq!(cells("\"5\"0,\"un"), ["50", "un"]);
    }

    #[test]
    fn plain_numbers_are_those_that_fill_their_cell() {
        let (mut reader, mut row) =
            (RowReader::new("1.5,-2,3e4,,7 ,9", b',', b'.'), CellRow::default());
        assert!(reader.read(&mut row));
        let plain: Vec<Option<f64>> = row.cells.iter().map(|cell| cell.plain).collect();
        assert_eq!(plain, [Some(1.5), Some(-2.0), None, None, None, Some(9.0)]);
        assert_eq!(reader.bytes_left(), 0);
    }
}

#[cfg(test)]
mod plain_number_tests {
    use proptest::prelude::*;

    use super::*;

    /// The same bits as the standard library's, or none where more than a number stands there.
    fn agrees(text: &str) -> Result<(), TestCaseError> {
        let (length, number) = plain_number(text.as_bytes(), b'.');
        prop_assert!(length <= text.len());
        if let Some(number) = number {
            let expected: f64 = text[..length].parse().unwrap();
            prop_assert_eq!(number.to_bits(), expected.to_bits(), "{}", text);
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn plain_numbers_are_those_of_the_standard_library(text in "[-+]?[0-9]{0,19}[.]?[0-9]{0,19}[e,x]?[0-9]{0,2}") {
            agrees(&text)?;
        }

        #[test]
        fn numbers_as_programs_write_them_are_read_back(number: f64, few in -1e7..1e7_f64, decimals in 0..9_usize) {
            agrees(&number.to_string())?;
            agrees(&format!("{few:.decimals$}"))?;
        }
    }

    #[test]
    fn what_is_usual_is_plain_and_all_else_is_left_to_others() {
        let read = |text: &str| plain_number(text.as_bytes(), b'.');
        assert_eq!(read("-12.50;7"), (6, Some(-12.5)));
        assert_eq!(read(".5"), (2, Some(0.5)));
        assert_eq!(read("5."), (2, Some(5.0)));
        assert_eq!(read("-0").1.map(f64::to_bits), Some((-0.0_f64).to_bits()));
        assert_eq!(read("9007199254740992").1, Some(9_007_199_254_740_992.0));
        for other in [
            "",
            "-",
            ".",
            "+.",
            "nan",
            "9007199254740993",
            "18446744073709551616",
            "00000000000000000001",
        ] {
            assert_eq!(read(other).1, None, "{other}");
        }
        assert_eq!(plain_number(b"1,5", b','), (3, Some(1.5)));
    }
}
