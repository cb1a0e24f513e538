//! A run's CSV file as columns of numbers.

use dynocar_model::units::{Dimension, Unit};

use super::cell::{held, is_word, lossy, not_a_value, parse_cell, truth};
use super::clock::DayClock;
use super::error::{DatasetError, NO_HEADER, NO_ROWS, SourcePosition};
use super::format::RunColumn;
use super::lines::{CellRow, RowReader, below, find_columns, names_of};
use super::manifest::ColumnMapping;
use super::quantity::Quantity;
use super::text_layout::TextLayout;

/// Number of rows from which the number of all rows is estimated.
const ROWS_BEFORE_RESERVE: usize = 1000;

/// The mapped columns of a run's file, each in its quantity's unit, `NaN` where missing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    columns: Vec<(Quantity, Vec<f64>)>,
    /// The line, from 1, of every row.
    line_of_row: Vec<usize>,
    /// The day of the first row, counted from 1970-01-01, where the times hold it.
    pub first_day: Option<i64>,
    /// Irregular lines.
    pub lines: LineCounts,
}

/// Lines of a file that are not plain rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct LineCounts {
    /// Rows of values, without a truncated last one.
    pub rows: usize,
    /// Lines between or below the rows that hold words alone: footers, the names again.
    pub notes: usize,
    /// Rows with fewer cells than the header; the cells at the end count as missing.
    pub short: usize,
    /// True when the file breaks off within its last line, which is then not used.
    pub truncated: bool,
}

impl Table {
    /// Returns the values of a quantity; `None` when it is not mapped.
    pub fn column(&self, quantity: Quantity) -> Option<&[f64]> {
        self.columns.iter().find(|(other, _)| *other == quantity).map(|(_, values)| &values[..])
    }

    /// Returns the values of a quantity, when at least one is there.
    pub fn filled(&self, quantity: Quantity) -> Option<&[f64]> {
        self.column(quantity).filter(|values| values.iter().any(|value| !value.is_nan()))
    }

    /// Returns the line of the file, from 1, in which a row stands.
    pub fn line(&self, row: usize) -> usize {
        self.line_of_row.get(row).copied().unwrap_or(0)
    }

    /// Returns the mapped columns with their values.
    pub fn columns(&self) -> impl Iterator<Item = (Quantity, &[f64])> {
        self.columns.iter().map(|(quantity, values)| (*quantity, &values[..]))
    }

    /// Puts the rows into another order.
    pub fn reorder(&mut self, order: &[usize]) {
        for (_, values) in &mut self.columns {
            *values = order.iter().map(|&row| values[row]).collect();
        }
        self.line_of_row = order.iter().map(|&row| self.line_of_row[row]).collect();
    }

    /// Replaces the values of a quantity.
    pub fn replace(&mut self, quantity: Quantity, values: Vec<f64>) {
        if let Some(column) = self.columns.iter_mut().find(|(other, _)| *other == quantity) {
            column.1 = values;
        }
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
        let kept = |row: &mut usize| {
            *row += 1;
            keep.get(*row - 1).copied().unwrap_or(false)
        };
        for (_, values) in &mut self.columns {
            let mut row = 0;
            values.retain(|_| kept(&mut row));
        }
        let mut row = 0;
        self.line_of_row.retain(|_| kept(&mut row));
    }

    /// Takes the columns of a run's file that is no text; a row's line is as if their names stood in the first.
    pub fn of_columns(
        label: &str,
        mut columns: Vec<RunColumn>,
        mappings: &[ColumnMapping],
    ) -> Result<Self, DatasetError> {
        let refuse = |problem| SourcePosition::whole(label).problem(problem);
        let names: Vec<String> = columns.iter().map(|it| it.name.trim().into()).collect();
        if names.is_empty() {
            return Err(refuse(NO_HEADER));
        }
        let indices = find_columns(&names, "", (&TextLayout::PLAIN, mappings))
            .map_err(|words| SourcePosition::line(label, 1).problem(words))?;
        let held_by = |(at, mapping): (usize, &ColumnMapping)| {
            let mut taken = indices[at].iter().map(|&index| {
                let values = &mut columns[index].values;
                // Its numbers stay where they are, unless another quantity needs them, too.
                let is_last = !indices[at + 1..].iter().flatten().any(|other| *other == index);
                if is_last { values.take() } else { values.clone() }.unwrap_or_default()
            });
            let (mut values, to) = (taken.next().unwrap_or_default(), mapping.converted_to());
            for part in taken {
                values.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
            }
            for value in &mut values {
                *value = held(mapping, to.as_ref(), *value);
            }
            (mapping.quantity, values)
        };
        let columns: Vec<(Quantity, Vec<f64>)> = mappings.iter().enumerate().map(held_by).collect();
        let rows = columns.first().map_or(0, |(_, values)| values.len());
        if rows == 0 {
            return Err(refuse(NO_ROWS));
        }
        let lines = LineCounts { rows, ..LineCounts::default() };
        Ok(Table { columns, line_of_row: (2..rows + 2).collect(), first_day: None, lines })
    }

    /// Reads a run's file.
    ///
    /// Cells are trimmed of spaces; empty cells, NaN and infinities are missing, except that an
    /// infinite curve radius is straight track.
    pub fn parse(
        label: &str,
        text: &str,
        (layout, mappings): (&TextLayout, &[ColumnMapping]),
    ) -> Result<Self, DatasetError> {
        let whole = text;
        let text = below(label, text, layout.skip_rows)?;
        let is_closed = text.ends_with(['\n', '\r']);
        let mut reader = RowReader::new(text, layout.delimiter, layout.decimal);
        let mut row = CellRow::default();
        if !reader.read(&mut row) {
            return Err(SourcePosition::whole(label).problem(NO_HEADER));
        }
        let names = names_of(&row);
        let indices = find_columns(&names, whole, (layout, mappings)).map_err(|words| {
            SourcePosition::line(label, layout.skip_rows + row.line).problem(words)
        })?;
        let columns = mappings.iter().zip(indices).map(|(mapping, indices)| {
            let clock = mapping.format.as_ref().map(DayClock::new);
            let converted_to = mapping.converted_to();
            Column { mapping, indices, converted_to, clock, values: Vec::new() }
        });
        let mut rows = Rows {
            label,
            width: names.len(),
            layout,
            columns: columns.collect(),
            line_of_row: Vec::new(),
            lines: LineCounts::default(),
            pending: None,
        };
        let mut has_row = reader.read(&mut row);
        if layout.units_row && has_row {
            rows.require_units(&row)?;
            has_row = reader.read(&mut row);
        }
        let bytes = reader.bytes_left();
        while has_row {
            rows.push(&row)?;
            if rows.lines.rows == ROWS_BEFORE_RESERVE {
                let left = reader.bytes_left();
                rows.reserve(left * ROWS_BEFORE_RESERVE / (bytes - left).max(1));
            }
            has_row = reader.read(&mut row);
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
    layout: &'m TextLayout,
    columns: Vec<Column<'m>>,
    line_of_row: Vec<usize>,
    lines: LineCounts,
    /// Flaw of the row last read. Whether it matters depends on whether the file breaks off there.
    pending: Option<Flaw>,
}

struct Column<'m> {
    mapping: &'m ColumnMapping,
    /// Where its cells stand; of several, which add up.
    indices: Vec<usize>,
    /// The quantity's unit, where the cells are in another.
    converted_to: Option<Unit>,
    /// Reads the cells that are times and no numbers.
    clock: Option<DayClock>,
    values: Vec<f64>,
}

enum Flaw {
    Short,
    /// The last cell is no number, but may be the beginning of one.
    CutNumber(DatasetError),
}

impl Rows<'_> {
    /// Makes room for `rows` more rows, where there is some: the number is a guess.
    fn reserve(&mut self, rows: usize) {
        for column in &mut self.columns {
            let _ = column.values.try_reserve(rows);
        }
        let _ = self.line_of_row.try_reserve(rows);
    }

    /// Returns true for a row with words in the place of values and without any value: a footer, the names once more,
    /// or the remains of a power cut.
    fn is_note(&self, row: &CellRow) -> bool {
        let mut cells = self.columns.iter().flat_map(|column| &column.indices);
        let first = cells.clone().next().map_or(&b""[..], |&index| row.trimmed(index));
        // Most rows hold a number there.
        is_word(first)
            && cells.all(|&index| row.trimmed(index).is_empty() || is_word(row.trimmed(index)))
            && row.cells.iter().all(|cell| !cell.text.contains(&b'\n'))
            && !(self.columns.iter().all(|column| {
                let cell = row.trimmed(column.indices[0]);
                parse_cell(cell, self.layout.marks()).is_some()
            }))
    }

    /// Refuses a row of values in the place of that of units, which would be lost.
    fn require_units(&self, row: &CellRow) -> Result<(), DatasetError> {
        for column in &self.columns {
            let cell = row.trimmed(column.indices[0]);
            let is_number = parse_cell(cell, self.layout.marks()).is_some_and(|it| !it.is_nan());
            // The unit "1" is one.
            if is_number && cell != b"1" {
                let place = SourcePosition::line(self.label, self.layout.skip_rows + row.line);
                return Err(place.problem(format!(
                    "units_row = true: expected units below the names, found the number {} in column \
                     '{}'",
                    lossy(cell),
                    column.mapping.column
                )));
            }
        }
        Ok(())
    }

    /// Adds a row; a fault in it stays pending.
    fn push(&mut self, row: &CellRow) -> Result<(), DatasetError> {
        let line = self.layout.skip_rows + row.line;
        let place = || SourcePosition::line(self.label, line);
        if line > self.layout.lines_above() + 1 && self.is_note(row) {
            self.lines.notes += 1;
            self.pending = None;
            return Ok(());
        }
        let found = row.cells.len();
        if found < self.width && row.cells.iter().any(|cell| cell.text.contains(&b'\n')) {
            let words = "a quoted cell runs over the end of the line: is a quote unclosed?";
            return Err(place().problem(words));
        }
        if (self.width..found).any(|index| !row.trimmed(index).is_empty()) {
            let hint = match self.layout.decimal {
                b'.' if found > self.width + 1 => "; are there decimal commas?",
                decimal if decimal == self.layout.delimiter => {
                    "; where commas separate the cells, numbers with decimal commas need quotes"
                }
                _ => "",
            };
            let width = self.width;
            let words = format!("{found} cells, but the header has {width} columns{hint}");
            return Err(place().problem(words));
        }
        self.pending = (found < self.width).then_some(Flaw::Short);
        for column in &mut self.columns {
            let (mut sum, mut flaw) = (0.0, None);
            for &index in &column.indices {
                let plain = row.cells.get(index).and_then(|cell| cell.plain);
                let value = match &mut column.clock {
                    None if plain.is_some() => plain,
                    None => {
                        let cell = row.trimmed(index);
                        let is_truth = column.mapping.quantity.dimension() == Dimension::Count;
                        let number = parse_cell(cell, self.layout.marks());
                        number.or_else(|| truth(cell).filter(|_| is_truth))
                    }
                    Some(_) if row.trimmed(index).is_empty() => Some(f64::NAN),
                    Some(clock) => clock.seconds(row.trimmed(index)),
                };
                sum += value.unwrap_or(f64::NAN);
                flaw = flaw.or(Some(index).filter(|_| value.is_none()));
            }
            column.values.push(held(column.mapping, column.converted_to.as_ref(), sum));
            let Some(index) = flaw else { continue };
            let cell = row.trimmed(index);
            let is_below_names = line <= self.layout.lines_above() + 1;
            let problem = not_a_value(column.mapping, cell, self.layout, is_below_names);
            let error = place().problem(problem);
            // The rest of a number where a file breaks off is such a cell.
            let may_be_cut = index + 1 == found
                && cell.iter().all(|letter| b"0123456789+-.,eE:T/ ".contains(letter));
            if !may_be_cut {
                return Err(error);
            }
            self.pending = Some(Flaw::CutNumber(error));
        }
        self.line_of_row.push(line);
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
            self.line_of_row.pop();
            for column in &mut self.columns {
                column.values.pop();
            }
        }
        if self.lines.rows == 0 {
            return Err(SourcePosition::whole(self.label).problem(NO_ROWS));
        }
        let first_day = self.columns.iter().find_map(|it| it.clock.as_ref()?.first_day());
        let columns = self.columns.into_iter();
        let columns = columns.map(|column| (column.mapping.quantity, column.values)).collect();
        Ok(Table { columns, line_of_row: self.line_of_row, first_day, lines: self.lines })
    }
}

#[cfg(test)]
mod tests;
