//! A run's CSV file as columns of numbers.

use csv::{ByteRecord, ReaderBuilder};

use super::error::{DatasetError, Place, Problem};
use super::manifest::{ColumnMapping, Manifest};
use super::names::Choices;
use super::quantity::Quantity;

/// The mapped columns of a run's file, each in its quantity's unit, `NaN` where missing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    columns: Vec<(Quantity, Vec<f64>)>,
    /// What was odd about the lines.
    pub lines: LineCounts,
}

/// Lines of a file that are not plain rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct LineCounts {
    /// Rows of values, without a truncated last one.
    pub rows: usize,
    /// Rows with fewer cells than the header; the cells at the end count as missing.
    pub short: usize,
    /// True when the file breaks off within its last line, which is then not used.
    pub truncated: bool,
}

impl Table {
    /// The values of a quantity; `None` when it is not mapped.
    pub fn column(&self, quantity: Quantity) -> Option<&[f64]> {
        self.columns.iter().find(|(other, _)| *other == quantity).map(|(_, values)| &values[..])
    }

    /// The values of a quantity, when at least one is there.
    pub fn filled(&self, quantity: Quantity) -> Option<&[f64]> {
        self.column(quantity).filter(|values| values.iter().any(|value| !value.is_nan()))
    }

    /// The mapped columns with their values.
    pub fn columns(&self) -> impl Iterator<Item = (Quantity, &[f64])> {
        self.columns.iter().map(|(quantity, values)| (*quantity, &values[..]))
    }

    /// Lets an empty cell of a quantity keep the last value before it.
    pub fn hold_last(&mut self, quantity: Quantity) {
        let columns = self.columns.iter_mut().filter(|(other, _)| *other == quantity);
        for (_, values) in columns {
            let mut last = f64::NAN;
            for value in values {
                last = if value.is_nan() { last } else { *value };
                *value = last;
            }
        }
    }

    /// Drops the rows whose mark is false.
    pub fn retain(&mut self, keep: &[bool]) {
        for (_, values) in &mut self.columns {
            let mut marks = keep.iter();
            values.retain(|_| *marks.next().unwrap_or(&false));
        }
    }

    /// Reads a run's file.
    ///
    /// Cells are trimmed of spaces; empty cells, NaN and infinities are missing, except that an
    /// infinite curve radius is straight track.
    pub fn parse(label: &str, text: &str, manifest: &Manifest) -> Result<Self, DatasetError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let is_closed = text.ends_with(['\n', '\r']);
        let mut reader = ReaderBuilder::new()
            .delimiter(manifest.delimiter)
            .has_headers(false)
            .flexible(true)
            .from_reader(text.as_bytes());
        let mut record = ByteRecord::new();
        let mut read = |record: &mut ByteRecord| match reader.read_byte_record(record) {
            Ok(has_more) => Ok(has_more),
            Err(error) => {
                let message = error.to_string();
                Err(Place::whole(label).problem(Problem::Syntax { language: "CSV", message }))
            }
        };
        if !read(&mut record)? {
            return Err(Place::whole(label).problem(Problem::NoHeader));
        }
        let header: Vec<String> = record.iter().map(|name| lossy(name).trim().into()).collect();
        let mut rows = Rows::new(label, manifest, &header)?;
        let mut has_row = read(&mut record)?;
        while has_row {
            rows.push(&record)?;
            has_row = read(&mut record)?;
            if has_row || is_closed {
                rows.settle()?;
            }
        }
        rows.finish()
    }
}

/// The rows read so far.
struct Rows<'m> {
    label: &'m str,
    width: usize,
    delimiter: u8,
    decimal: u8,
    columns: Vec<Column<'m>>,
    lines: LineCounts,
    /// What is wrong with the row last read. Whether it matters depends on whether the file
    /// breaks off there.
    pending: Option<Flaw>,
}

struct Column<'m> {
    mapping: &'m ColumnMapping,
    index: usize,
    values: Vec<f64>,
}

enum Flaw {
    Short,
    /// The last cell is no number, but may be the beginning of one.
    CutNumber(DatasetError),
}

impl<'m> Rows<'m> {
    fn new(
        label: &'m str,
        manifest: &'m Manifest,
        header: &[String],
    ) -> Result<Self, DatasetError> {
        let mut columns = Vec::with_capacity(manifest.columns.len());
        for mapping in &manifest.columns {
            let index = find_column(label, mapping, header, manifest.delimiter)?;
            columns.push(Column { mapping, index, values: Vec::new() });
        }
        Ok(Rows {
            label,
            width: header.len(),
            delimiter: manifest.delimiter,
            decimal: manifest.decimal,
            columns,
            lines: LineCounts::default(),
            pending: None,
        })
    }

    /// Takes in a row; what is wrong with it stays pending.
    fn push(&mut self, record: &ByteRecord) -> Result<(), DatasetError> {
        let line = record.position().map_or(0, |position| position.line() as usize);
        let place = || Place::line(self.label, line);
        if record.len() < self.width && record.as_slice().contains(&b'\n') {
            return Err(place().problem(Problem::UnclosedQuote));
        }
        if record.iter().skip(self.width).any(|cell| !cell.trim_ascii().is_empty()) {
            let hint = match self.decimal {
                b'.' if record.len() > self.width + 1 => "; are there decimal commas?",
                decimal if decimal == self.delimiter => {
                    "; where commas separate the cells, numbers with decimal commas need quotes"
                }
                _ => "",
            };
            let (expected, found) = (self.width, record.len());
            return Err(place().problem(Problem::TooManyCells { expected, found, hint }));
        }
        self.pending = (record.len() < self.width).then_some(Flaw::Short);
        for column in &mut self.columns {
            let cell = record.get(column.index).unwrap_or(b"").trim_ascii();
            let value = parse_cell(cell, self.decimal);
            column.values.push(value.map_or(f64::NAN, |value| held(column.mapping, value)));
            if value.is_some() {
                continue;
            }
            let error = place().problem(not_a_number(column.mapping, cell, self.decimal));
            // What is left of a number where a file breaks off is such a cell.
            let may_be_cut = column.index + 1 == record.len()
                && cell.iter().all(|letter| b"0123456789+-.,eE".contains(letter));
            if !may_be_cut {
                return Err(error);
            }
            self.pending = Some(Flaw::CutNumber(error));
        }
        self.lines.rows += 1;
        Ok(())
    }

    /// Decides on the row last read, knowing that the file goes on after it or ends with a
    /// finished line.
    fn settle(&mut self) -> Result<(), DatasetError> {
        match self.pending.take() {
            None => Ok(()),
            Some(Flaw::Short) => {
                self.lines.short += 1;
                Ok(())
            }
            Some(Flaw::CutNumber(error)) => Err(error),
        }
    }

    fn finish(mut self) -> Result<Table, DatasetError> {
        if self.pending.is_some() {
            self.lines.truncated = true;
            self.lines.rows -= 1;
            for column in &mut self.columns {
                column.values.pop();
            }
        }
        if self.lines.rows == 0 {
            return Err(Place::whole(self.label).problem(Problem::NoRows));
        }
        let columns = self.columns.into_iter();
        let columns = columns.map(|column| (column.mapping.quantity, column.values)).collect();
        Ok(Table { columns, lines: self.lines })
    }
}

fn find_column(
    label: &str,
    mapping: &ColumnMapping,
    header: &[String],
    delimiter: u8,
) -> Result<usize, DatasetError> {
    let name = &mapping.column;
    let count = header.iter().filter(|other| *other == name).count();
    let problem = match count {
        1 => return Ok(header.iter().position(|other| other == name).unwrap_or(0)),
        0 => {
            let other = [';', ',', '\t', '|'].into_iter().find(|mark| header[0].contains(*mark));
            match (header.len(), other) {
                (1, Some(found)) => {
                    Problem::OtherDelimiter { expected: char::from(delimiter), found }
                }
                _ => {
                    let context = format!(" (for {} in {})", mapping.quantity, mapping.place);
                    let choices = Choices::new(name, header.iter().cloned());
                    Problem::UnknownName { what: "column", name: name.clone(), context, choices }
                }
            }
        }
        _ => Problem::RepeatedColumn { column: name.clone(), count },
    };
    Err(Place::line(label, 1).problem(problem))
}

/// The number in a trimmed cell, `NaN` for an empty one; `None` when it is something else.
pub(super) fn parse_cell(cell: &[u8], decimal: u8) -> Option<f64> {
    if cell.is_empty() {
        return Some(f64::NAN);
    }
    let text = std::str::from_utf8(cell).ok()?;
    if decimal == b',' {
        // A point would be a mark of thousands here, or a mistake: neither is a number.
        return if text.contains('.') { None } else { text.replace(',', ".").parse().ok() };
    }
    text.parse().ok()
}

/// A greater number in SI units is none of a railway's; its square or sum might be infinite.
const MAGNITUDE_MAX: f64 = 1e15;

/// A cell's number as it is kept: in the quantity's unit, missing when infinite or as good as that.
fn held(mapping: &ColumnMapping, cell: f64) -> f64 {
    if mapping.quantity == Quantity::CurveRadius && cell.is_infinite() {
        return 0.0;
    }
    let value = mapping.convert(cell);
    if value.abs() <= MAGNITUDE_MAX { value } else { f64::NAN }
}

fn not_a_number(mapping: &ColumnMapping, cell: &[u8], decimal: u8) -> Problem {
    let printable = |letter: char| if letter.is_control() { ' ' } else { letter };
    let text = lossy(cell).chars().take(60).map(printable).collect();
    let with_point: Vec<u8> =
        cell.iter().map(|&letter| if letter == b',' { b'.' } else { letter }).collect();
    let is_comma = decimal == b'.' && parse_cell(&with_point, b'.').is_some();
    let hint = if is_comma { "; for decimal commas set decimal = \",\" in [dataset]" } else { "" };
    Problem::NotANumber { column: mapping.column.clone(), text, hint }
}

fn lossy(bytes: &[u8]) -> std::borrow::Cow<'_, str> {
    String::from_utf8_lossy(bytes)
}

#[cfg(test)]
mod tests;
