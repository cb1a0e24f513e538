//! Division of a file's text into cells: delimiter, decimal mark, the lines above the names, names and units.
use dynocar_model::units::is_unit;

use super::name::Name;
use crate::cell::{is_missing, parse_cell, ungrouped};
use crate::error::{DatasetError, NO_HEADER, NO_ROWS, SourcePosition};
use crate::lines::{self, RowReader};
use crate::text_layout::{Marks, THOUSANDS};
use crate::{TextLayout, TimeFormat};

/// Possible separators of cells, in the order of preference.
const DELIMITERS: [u8; 4] = *b";\t|,";
/// Types of numbers and times, without their bits.
const TYPES: &str = "double float real single date int integer uint long number numeric decimal dbl flt sgl timestamp datetime \
                     bigint smallint tinyint i u f";
/// Number of rows that show the layout.
const ROWS_MAX: usize = 200;

/// How a file's text is divided into cells.
#[derive(Clone, Debug, PartialEq)]
pub struct GuessedLayout {
    /// The layout in the terms of a dataset.
    pub text: TextLayout,
    /// The columns' names, with the units that stand below them.
    pub header: Vec<Name>,
}

/// A row of the file.
struct Row {
    line: usize,
    cells: Vec<String>,
}

/// Where names, units and values stand among the rows.
#[derive(Clone, Copy)]
struct Block {
    header: usize,
    units: Option<usize>,
}

/// Recognises the layout of a file, with the delimiter that is given, if one is.
///
/// # Errors
///
/// Where no line above the values holds names of columns, or no values follow.
pub fn layout(
    label: &str,
    text: &str,
    delimiter: Option<u8>,
) -> Result<GuessedLayout, DatasetError> {
    let readings = readings(text, delimiter);
    let wrong = |line: usize, words: String| Err(SourcePosition::line(label, line).problem(words));
    let rows = &readings[0].2;
    if rows.iter().all(|row| row.filled().next().is_none()) {
        return Err(SourcePosition::whole(label).problem(NO_HEADER));
    }
    let best =
        readings.iter().max_by(|one, other| fit(one.1, &one.2).total_cmp(&fit(other.1, &other.2)));
    let Some((mark, block, rows)) =
        best.filter(|(.., rows)| rows.iter().any(|row| row.cells.len() > 1))
    else {
        let found = Name::parse(&rows[0].cells.join(",")).shown();
        return wrong(
            1,
            format!(
                "expected names of columns separated by {}, found only '{found}': --delimiter says \
                 another mark",
                delimiter.map_or("a comma, semicolon, tab or |".into(), shown_mark)
            ),
        );
    };
    let Some(Block { header, units }) = *block else {
        let found = rows[0].cells[0].trim();
        return wrong(
            rows[0].line,
            format!(
                "expected names of columns, found '{found}': write the names into a line above"
            ),
        );
    };
    let (names, values) = (&rows[header], &rows[units.unwrap_or(header) + 1..]);
    if values.is_empty() {
        return Err(SourcePosition::whole(label).problem(NO_ROWS));
    }
    let (found, usual) = (names.cells.len(), usual_width(values).unwrap_or(0));
    if found < usual {
        return wrong(
            names.line,
            format!(
                "expected names of columns, found {found} cells above rows of {usual}: write a name \
                 for every column"
            ),
        );
    }
    let units = units.map(|units| &rows[units]);
    let name = |(index, cell): (usize, &String)| {
        let unit = units.and_then(|row| row.cells.get(index)).map(|cell| without_brackets(cell));
        Name::parse(cell).with_unit(unit.filter(|unit| !unit.is_empty() && is_unit(unit)))
    };
    let (delimiter, skip_rows) = (*mark, names.line - 1);
    let units_row = units.is_some();
    Ok(GuessedLayout {
        text: TextLayout { delimiter, skip_rows, units_row, ..TextLayout::PLAIN },
        header: names.cells.iter().enumerate().map(name).collect(),
    })
}

/// Returns the first rows as each possible delimiter divides them, with their names and units.
fn readings(text: &str, given: Option<u8>) -> Vec<(u8, Option<Block>, Vec<Row>)> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let reading = |delimiter: u8| {
        let rows = first_rows(text, delimiter);
        (delimiter, block(&rows), rows)
    };
    given.map_or(DELIMITERS.to_vec(), |it| vec![it]).into_iter().map(reading).collect()
}

/// Returns a delimiter for people.
pub fn shown_mark(delimiter: u8) -> String {
    match delimiter {
        b'\t' => "a tab".into(),
        mark => format!("'{}'", char::from(mark)),
    }
}

fn first_rows(text: &str, delimiter: u8) -> Vec<Row> {
    let mut reader = RowReader::new(text, delimiter, b'.');
    let (mut rows, mut row) = (Vec::new(), lines::CellRow::default());
    while rows.len() <= ROWS_MAX && reader.read(&mut row) {
        let cells = row.cells.iter().map(|cell| String::from_utf8_lossy(&cell.text).into());
        rows.push(Row { line: row.line, cells: cells.collect() });
    }
    rows
}

impl Row {
    fn filled(&self) -> impl Iterator<Item = &str> {
        self.cells.iter().map(|cell| cell.trim()).filter(|cell| !cell.is_empty())
    }

    /// Returns the cells that hold a number or a time.
    fn values(&self) -> usize {
        self.filled().filter(|cell| is_value(cell)).count()
    }

    /// Returns whether most cells hold values.
    fn is_of_values(&self) -> bool {
        2 * self.values() > self.filled().count()
    }

    /// Returns true for words: names, units. The unit of a share is 1; a word for a missing value may be a name.
    fn is_of_words(&self) -> bool {
        let mut own = self.filled().filter(|cell| *cell != "1").peekable();
        own.peek().is_some() && !own.any(|cell| is_value(cell) && !is_missing(cell))
    }

    /// Returns true for the names of types of numbers and times.
    fn is_of_types(&self) -> bool {
        let is_type = |cell: &str| {
            // ClickHouse writes `Nullable(DateTime64(6))`.
            let word = cell.to_lowercase().replace("nullable(", "");
            let kind = word.split(['(', ')']).next().unwrap_or_default();
            let kind = kind.trim_end_matches(|it: char| it.is_ascii_digit());
            TYPES.split(' ').any(|it| it == kind) || word.starts_with("datetime64")
        };
        self.filled().next().is_some() && self.filled().all(is_type)
    }

    /// Returns whether at least half of the cells are units and none is a value. Letters alone are as well the
    /// names of columns: t, v, F; but not where less of them stand there than above.
    fn is_of_units(&self, names: &Row) -> bool {
        let cells: Vec<String> = self.filled().map(without_brackets).collect();
        let units: Vec<&String> = cells.iter().filter(|cell| is_unit(cell)).collect();
        let is_plain = units.iter().any(|unit| unit.chars().count() > 1);
        // Names leave no cell empty, units may.
        let is_plain = is_plain || cells.len() < names.filled().count().min(names.cells.len());
        self.is_of_words() && is_plain && 2 * units.len() >= cells.len()
    }
}

fn is_value(cell: &str) -> bool {
    let cell = cell.as_bytes();
    let is_plain = |mark| parse_cell(cell, Marks::plain(mark)).is_some();
    is_plain(b'.') || is_plain(b',') || is_grouped(cell) || !TimeFormat::of_cell(cell).is_empty()
}

/// Returns true for a number with marks between its groups of three digits.
fn is_grouped(cell: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(cell) else { return false };
    let is_it = |mark: char| {
        let decimal = if mark == '.' { ',' } else { '.' };
        text.contains(mark)
            && [decimal, ','].into_iter().any(|it| ungrouped(text, mark, it).is_some())
    };
    THOUSANDS.into_iter().any(is_it)
}

fn without_brackets(cell: &str) -> String {
    cell.trim().trim_matches(['[', ']', '(', ')']).to_string()
}

/// Returns where names and units stand: in the words above the first two rows of values that follow each other;
/// `None` where there are values and no words above them.
fn block(rows: &[Row]) -> Option<Block> {
    let is_start = |index: &usize| {
        let next = rows.get(index + 1);
        rows[*index].is_of_values() && next.is_none_or(|row| row.values() > 0)
    };
    let Some(values) = (0..rows.len()).find(is_start) else {
        return Some(Block { header: 0, units: None });
    };
    let words = (0..values).rev().find(|&index| rows[index].is_of_words())?;
    let above = words.checked_sub(1).filter(|&above| {
        let (names, units) = (&rows[above], &rows[words]);
        let is_below = units.is_of_units(names)
            || units.is_of_types() && !names.is_of_types() && !is_below_names(rows, above);
        is_below && names.is_of_words() && names.filled().count() >= units.filled().count()
    });
    Some(Block { header: above.unwrap_or(words), units: above.map(|_| words) })
}

/// Returns true for a line of units that stands below names itself.
fn is_below_names(rows: &[Row], at: usize) -> bool {
    at.checked_sub(1).is_some_and(|above| rows[at].is_of_units(&rows[above]))
}

/// Returns how well the rows fall into columns: the more columns the better, where rows agree on them with
/// each other and with the header, and their cells hold values: a comma in names or numbers separates none.
fn fit(block: Option<Block>, rows: &[Row]) -> f64 {
    let first = block.map_or(0, |block| block.units.unwrap_or(block.header) + 1);
    let values = &rows[first.min(rows.len())..];
    let rows = &rows[block.map_or(0, |block| block.header)..];
    let Some(width) = usual_width(rows).filter(|width| *width > 1) else { return 0.0 };
    let agree = rows.iter().filter(|row| row.cells.len() == width).count();
    let of_header = if rows[0].cells.len() == width { 1.0 } else { 0.05 };
    let filled: usize = values.iter().map(|row| row.filled().count()).sum();
    let of_values: usize = values.iter().map(Row::values).sum();
    // Without any value one delimiter may still be better than the others.
    let shares = [(agree, rows.len()), (1 + of_values, 1 + filled)];
    let shares = shares.map(|(part, whole)| (part as f64 / whole as f64).powi(2));
    of_header * width as f64 * shares[0] * shares[1]
}

/// Returns the number of cells that most rows have.
fn usual_width(rows: &[Row]) -> Option<usize> {
    let mut widths: Vec<usize> = rows.iter().map(|row| row.cells.len()).collect();
    widths.sort_unstable();
    widths.get(widths.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recognised(text: &str) -> (char, char, usize) {
        let file = crate::guess::RecordingText { label: "a.csv", text };
        let marks = crate::guess::GivenMarks::default();
        let read = crate::guess::columns::InspectedColumns::read(&[file], marks).unwrap().layout;
        let TextLayout { delimiter, decimal, .. } = read.text;
        (char::from(delimiter), char::from(decimal), read.header.len())
    }

    fn refusal(text: &str) -> String {
        layout("a.csv", text, None).unwrap_err().to_string()
    }

    #[test]
    fn delimiter_and_decimal_mark_are_distinguished() {
        assert_eq!(recognised("t,v\n0,1.5\n1,2.5\n"), (',', '.', 2));
        assert_eq!(recognised("t;v\n0;1,5\n1;2,5\n"), (';', ',', 2));
        assert_eq!(recognised("t;v\n0,5;1,5\n1;2,5\n"), (';', ',', 2));
        assert_eq!(recognised("t\tv\tF\n0\t1\t3\n"), ('\t', '.', 3));
        assert_eq!(recognised("t|v\n0|1.5\n"), ('|', '.', 2));
        assert_eq!(recognised("t,v\n\"0,5\",\"1,5\"\n"), (',', ',', 2));
        assert_eq!(recognised("\u{feff}t;v, measured\n0;1.0\n"), (';', '.', 2));
        assert_eq!(recognised("t,v,note\n0,1.5,\"a;b\"\n1,1.5,\"c;d\"\n"), (',', '.', 3));
    }

    #[test]
    fn a_name_may_hold_any_mark_but_the_delimiter() {
        let rows = |delimiter: &str, decimal: &str| {
            let row = |it: u32| [it, 3 * it, 40 + it].map(|it| format!("{it}{decimal}5"));
            (0..9).map(|it| row(it).join(delimiter) + "\n").collect::<String>()
        };
        for (delimiter, decimals) in [(",", "."), (";", ".,"), ("\t", ".,"), ("|", ".,")] {
            for inner in [",", ";", "|"].into_iter().filter(|it| *it != delimiter) {
                let names = ["Zeit", "Weg", "Geschwindigkeit"].map(|it| format!("{it}{inner} x"));
                for decimal in decimals.chars() {
                    let text = format!(
                        "{}\n{}",
                        names.join(delimiter),
                        rows(delimiter, &decimal.to_string())
                    );
                    let delimiter = delimiter.chars().next().unwrap();
                    assert_eq!(recognised(&text), (delimiter, decimal, 3), "{text}");
                }
            }
        }
    }

    #[test]
    fn what_has_no_header_or_no_rows_is_refused_with_its_line() {
        assert!(refusal("").contains("a.csv: expected a header line"));
        assert!(refusal("\n\n").contains("expected a header line"));
        assert!(refusal("t,v\n").contains("a.csv: expected rows of values below the header"));
        assert!(refusal("hello\nworld\n").starts_with("a.csv:1: expected names of columns"));
        assert!(refusal("0,1\n1,2\n").starts_with("a.csv:1: expected names of columns, found '0'"));
        let message = refusal("t,v\n0,1,2\n1,2,3\n2,3,4\n");
        assert!(
            message.contains("a.csv:1") && message.contains("2 cells above rows of 3"),
            "{message}"
        );
        assert!(refusal("Logger\n0,1\n1,2\n").contains("1 cells above rows of 2"));
    }

    #[test]
    fn lines_above_the_names_and_units_below_them_are_distinguished() {
        let read = |text: &str| {
            let layout = layout("a.csv", text, None).unwrap();
            let names: Vec<String> = layout.header.iter().map(|name| name.text.clone()).collect();
            let units: Vec<Option<String>> =
                layout.header.iter().map(|it| it.unit.clone()).collect();
            (layout.text.skip_rows, layout.text.units_row, names.join(" "), units)
        };
        let unit = |text: &str| Some(text.to_string());
        let (none, plain) = (vec![None, None, None], "t v F".to_string());
        let rows = "0,1,2\n1,2,3\n2,3,4\n";
        assert_eq!(read(&format!("t,v,F\n{rows}")), (0, false, plain.clone(), none.clone()));
        assert_eq!(
            read(&format!("Recorder X,v2\nt,v,F\n{rows}")),
            (1, false, plain.clone(), none.clone())
        );
        let padded =
            format!("Logger;XY 7;\nSerial;1234;\n\nt;v;F\ns;km/h;[kN]\n{rows}").replace(',', ";");
        let units = vec![unit("s"), unit("km/h"), unit("kN")];
        assert_eq!(read(&padded), (3, true, plain.clone(), units), "a blank line counts, too");
        let tabular = format!("Zug;Fahrer;Strecke\nET 1;X;Y\nt;v;F\n{rows}").replace(',', ";");
        assert_eq!(read(&tabular), (2, false, plain.clone(), none.clone()), "letters are names");
        assert_eq!(read(&padded.replace('\n', "\r\n")).0, 3, "as Windows ends lines");
        let unfilled = format!("t,v,F\ns,,\n{rows}");
        assert_eq!(read(&unfilled), (0, true, plain.clone(), vec![unit("s"), None, None]));
        let timed =
            "Messung vom 18.03.2026\nZeit;v;F\n;km/h;kN\n07:13:20,2;1,5;\n07:13:20,4;1,6;\n";
        let (skip_rows, units_row, names, _) = read(timed);
        assert_eq!((skip_rows, units_row, &names[..]), (1, true, "Zeit v F"));
        let missing = format!("t,v,F\n0,n/a,n/a\n{rows}");
        assert_eq!(read(&missing), (0, false, plain, none), "text among the values is no header");
    }
}
