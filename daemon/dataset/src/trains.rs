//! Files that hold the rows of several trains: their detection, and the choice of one train's rows.

use std::borrow::Cow;

use super::cell::truth;
use super::error::{DatasetError, SourcePosition};
use super::format::{TrainColumn, place_of};
use super::lines::{CellRow, RowReader, below};
use super::quantity::Quantity;
use super::table::Table;
use super::text_layout::TextLayout;

/// Names of columns that name the train of a row, in small letters and digits.
const NAMES: &str = "vehicle vehicleid vehid veh vehiclename vehicleno vehiclenumber train trainid trainno trainnr \
                     trainnumber trainname trainset unit unitid unitno unitnumber loco locoid locono locomotive \
                     locomotiveid locomotivenumber fahrzeug fahrzeugid fahrzeugnr fahrzeugnummer zug zugid zugnr \
                     zugnummer triebzug triebzugnr lok lokid loknr loknummer rame numerorame numerotrain tren treno \
                     idtren idtreno поезд номерпоезда";
/// Change of a position in m, in addition to twice the distance by the speed, above which the row is another train's.
const JUMP_MIN_M: f64 = 100.0;
/// Line of the first row if the names stand in the first line.
const FIRST_ROW_LINE: usize = 2;
/// Greatest number of trains that a message names.
const SHOWN_MAX: usize = 8;

/// Returns true for the name of a column that names the train of each row.
pub fn names_trains(name: &str) -> bool {
    let letters = name.chars().filter(|letter| letter.is_alphanumeric());
    let folded: String = letters.flat_map(char::to_lowercase).collect();
    NAMES.split(' ').any(|known| known == folded)
}

/// The cells of a column that names trains, one after the other.
#[derive(Clone, Debug, Default)]
pub struct TrainCells {
    trains: Vec<String>,
    changes: Vec<usize>,
    before: Option<usize>,
}

impl TrainCells {
    /// Takes the next cell; `line` counts from 1. An empty one says nothing.
    pub fn push(&mut self, cell: &str, line: usize) {
        if cell.is_empty() {
            return;
        }
        let place = place_of(cell, &mut self.trains);
        if self.before.replace(place).is_some_and(|it| it != place) {
            self.changes.push(line);
        }
    }

    /// Returns the trains by the column of this name; `None` where the cells name no several.
    pub fn column(self, name: String) -> Option<TrainsColumn> {
        let TrainCells { trains, changes, .. } = self;
        let is_mark = |it: &String| truth(it.as_bytes()).is_some() || ["0", "1"].contains(&&it[..]);
        let is_several = trains.len() > 1 && !trains.iter().all(is_mark);
        is_several.then_some(TrainsColumn { name, trains, changes })
    }
}

/// The trains in a text by a column that names them.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainsColumn {
    /// The column's name.
    pub name: String,
    /// The trains, as they come.
    pub trains: Vec<String>,
    /// The lines, from 1, where another train follows.
    changes: Vec<usize>,
}

impl TrainsColumn {
    /// Returns the trains that a text's rows are of; `None` where no column names several.
    pub fn new(text: &str, layout: &TextLayout) -> Option<Self> {
        let (name, index) = column(text, layout, names_trains)?;
        let mut cells = TrainCells::default();
        rows(text, layout, |row, line| {
            cells.push(&String::from_utf8_lossy(row.trimmed(index)), line);
        });
        cells.column(name)
    }

    /// Returns the trains that a table's rows are of; `None` where its column names no several.
    pub(super) fn of_table(column: &TrainColumn) -> Option<Self> {
        let mut cells = TrainCells::default();
        column.cells().zip(FIRST_ROW_LINE..).for_each(|(cell, line)| cells.push(cell, line));
        cells.column(column.name.clone())
    }

    /// Returns whether a train comes again after another: no train changes its number so.
    pub fn is_interleaved(&self) -> bool {
        self.changes.len() >= self.trains.len()
    }

    /// Returns whether from one train to another the time does not go on, or the position jumps under way.
    fn begins_anew(&self, table: &Table) -> bool {
        let column = |quantity| table.column(quantity).unwrap_or_default();
        let (times_s, speeds) = (column(Quantity::Time), column(Quantity::Speed));
        let positions_m = column(Quantity::Position);
        let is_change = |row: usize| self.changes.binary_search(&table.line(row)).is_ok();
        (1..times_s.len()).filter(|&row| is_change(row)).any(|row| {
            let step_s = times_s[row] - times_s[row - 1];
            let moved_m = speeds.get(row - 1).map_or(0.0, |speed_mps| speed_mps * step_s);
            let jump_m =
                positions_m.get(row).map_or(0.0, |at_m| (at_m - positions_m[row - 1]).abs());
            step_s <= 0.0 || moved_m > 0.0 && jump_m > JUMP_MIN_M + 2.0 * moved_m
        })
    }

    /// Says that the rows are of several trains.
    pub fn words(&self) -> String {
        let shown: Vec<String> =
            self.trains.iter().take(SHOWN_MAX).map(|it| format!("'{it}'")).collect();
        let more = if self.trains.len() > SHOWN_MAX { ", …" } else { "" };
        format!(
            "the rows are of {} trains, by column '{}': {}{more}",
            self.trains.len(),
            self.name,
            shown.join(", ")
        )
    }

    /// The error of a table of several trains' rows.
    pub(super) fn refuse(&self, label: &str, table: &Table) -> Result<(), DatasetError> {
        if !self.is_interleaved() && !self.begins_anew(table) {
            return Ok(());
        }
        let (words, name, first) = (self.words(), &self.name, &self.trains[0]);
        Err(SourcePosition::whole(label).problem(format!(
            "{words}; choose one: --train of `dynocar init`, or in dataset.toml [train] rows = {{ column = {name:?}, \
             value = {first:?} }}, or rows = \"all\" where they are one"
        )))
    }
}

/// Returns a text with the rows of one train alone; lines of others are empty.
///
/// # Errors
///
/// When no such column or no row of the train is there.
pub fn only<'t>(
    label: &str,
    text: &'t str,
    layout: &TextLayout,
    (name, value): (&str, &str),
) -> Result<Cow<'t, str>, DatasetError> {
    let (_, index) = column(text, layout, |other| other == name)
        .ok_or_else(|| no_column(label, layout.skip_rows + 1, name))?;
    let mut others = Vec::new();
    let mut count = 0;
    rows(text, layout, |row, line| {
        let is_own = row.trimmed(index) == value.as_bytes();
        count += usize::from(is_own);
        if !is_own {
            others.push(line);
        }
    });
    if count == 0 {
        return Err(no_row(label, (name, value), TrainsColumn::new(text, layout)));
    }
    let mut others = others.into_iter().peekable();
    let kept = text.split_inclusive('\n').zip(1..).map(|(whole, line)| {
        let is_other = others.next_if_eq(&line).is_some();
        if is_other { "\n" } else { whole }
    });
    Ok(Cow::Owned(kept.collect()))
}

/// Drops a table's rows of other trains.
///
/// # Errors
///
/// When no such column or no row of the train is there.
pub(super) fn keep_only(
    label: &str,
    table: &mut Table,
    column: Option<&TrainColumn>,
    (name, value): (&str, &str),
) -> Result<(), DatasetError> {
    let column = column.ok_or_else(|| no_column(label, FIRST_ROW_LINE - 1, name))?;
    let own: Vec<bool> = column.cells().map(|cell| cell == value).collect();
    if !own.contains(&true) {
        return Err(no_row(label, (name, value), TrainsColumn::of_table(column)));
    }
    table.retain(&own);
    table.lines.rows = own.iter().filter(|&&is_own| is_own).count();
    Ok(())
}

fn no_column(label: &str, line: usize, name: &str) -> DatasetError {
    let words = format!("no column '{name}' for [train] rows");
    SourcePosition::line(label, line).problem(words)
}

/// Returns the error of a train that has no row; `found` are those of a column that names trains.
fn no_row(label: &str, (name, value): (&str, &str), found: Option<TrainsColumn>) -> DatasetError {
    let found = found.filter(|it| it.name == name);
    let found = found.map_or(String::new(), |it| format!("; {}", it.words()));
    let words = format!("no row of train '{value}' in column '{name}'{found}");
    SourcePosition::whole(label).problem(words)
}

/// Returns the name and place of the first column whose name passes.
fn column(
    text: &str,
    layout: &TextLayout,
    passes: impl Fn(&str) -> bool,
) -> Option<(String, usize)> {
    let text = below("", text, layout.skip_rows).ok()?;
    let mut names = CellRow::default();
    RowReader::new(text, layout.delimiter, layout.decimal).read(&mut names);
    let mut names = names.cells.iter().map(|cell| String::from_utf8_lossy(&cell.text));
    let (index, name) = names.by_ref().enumerate().find(|(_, name)| passes(name.trim()))?;
    Some((name.trim().to_owned(), index))
}

/// Gives every row of values with its line, from 1.
fn rows(text: &str, layout: &TextLayout, mut take: impl FnMut(&CellRow, usize)) {
    let Ok(text) = below("", text, layout.skip_rows) else { return };
    let mut reader = RowReader::new(text, layout.delimiter, layout.decimal);
    let mut row = CellRow::default();
    let mut above = 1 + usize::from(layout.units_row);
    while reader.read(&mut row) {
        if above > 0 {
            above -= 1;
        } else {
            take(&row, layout.skip_rows + row.line);
        }
    }
}
