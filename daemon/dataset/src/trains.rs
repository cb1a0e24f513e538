//! Files that hold the rows of several trains: noticed, and those of one chosen.

use std::borrow::Cow;

use super::cell::truth;
use super::document::Item;
use super::error::{DatasetError, SourcePosition};
use super::lines::{Row, RowReader, below};
use super::quantity::Quantity;
use super::table::Table;
use super::text_layout::TextLayout;

/// Names of columns that say whose the row is, in small letters and digits.
const NAMES: &str = "vehicle vehicleid vehid veh vehiclename vehicleno vehiclenumber train trainid trainno trainnr \
                     trainnumber trainname trainset unit unitid unitno unitnumber loco locoid locono locomotive \
                     locomotiveid locomotivenumber fahrzeug fahrzeugid fahrzeugnr fahrzeugnummer zug zugid zugnr \
                     zugnummer triebzug triebzugnr lok lokid loknr loknummer rame numerorame numerotrain tren treno \
                     idtren idtreno поезд номерпоезда";
/// Trains that a message names at most.
const SHOWN_MAX: usize = 8;

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

/// True for a column's name that says whose the rows are.
pub fn names_trains(name: &str) -> bool {
    let letters = name.chars().filter(|letter| letter.is_alphanumeric());
    let folded: String = letters.flat_map(char::to_lowercase).collect();
    NAMES.split(' ').any(|known| known == folded)
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
    /// The trains that a text's rows are of; `None` where no column names several.
    pub fn of(text: &str, layout: &TextLayout) -> Option<Self> {
        let (name, index) = column(text, layout, names_trains)?;
        let (mut trains, mut changes): (Vec<String>, Vec<usize>) = Default::default();
        let mut before = None;
        rows(text, layout, |row, line| {
            let cell = row.trimmed(index);
            if cell.is_empty() {
                return;
            }
            let text = String::from_utf8_lossy(cell);
            let known = trains.iter().position(|it| *it == text);
            let place = known.unwrap_or_else(|| {
                trains.push(text.into_owned());
                trains.len() - 1
            });
            if before.replace(place).is_some_and(|it| it != place) {
                changes.push(line);
            }
        });
        let is_mark =
            trains.iter().all(|it| truth(it.as_bytes()).is_some() || ["0", "1"].contains(&&it[..]));
        (trains.len() > 1 && !is_mark).then_some(TrainsColumn { name, trains, changes })
    }

    /// True where a train comes again after another: no train changes its number so.
    pub fn is_interleaved(&self) -> bool {
        self.changes.len() >= self.trains.len()
    }

    /// True where the time does not go on from one train to another.
    fn begins_anew(&self, table: &Table) -> bool {
        let Some(times_s) = table.column(Quantity::Time) else { return false };
        let is_change = |row: usize| self.changes.binary_search(&table.line(row)).is_ok();
        (1..times_s.len()).any(|row| times_s[row] <= times_s[row - 1] && is_change(row))
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
            "{words}; choose one: `dynocar init --train`, or [train] {KEY} = {{ column = {name:?}, value = {first:?} \
             }} in dataset.toml; {KEY} = \"{ALL}\" where they are one"
        )))
    }
}

/// A text with the rows of one train alone; lines of others are empty.
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
    let at_names = || SourcePosition::line(label, layout.skip_rows + 1);
    let (_, index) = column(text, layout, |other| other == name)
        .ok_or_else(|| at_names().problem(format!("no column '{name}' for [train] {KEY}")))?;
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
        let found = TrainsColumn::of(text, layout).filter(|it| it.name == name);
        let found = found.map_or(String::new(), |it| format!("; {}", it.words()));
        return Err(SourcePosition::whole(label)
            .problem(format!("no row of train '{value}' in column '{name}'{found}")));
    }
    let mut others = others.into_iter().peekable();
    let kept = text.split_inclusive('\n').zip(1..).map(|(whole, line)| {
        let is_other = others.next_if_eq(&line).is_some();
        if is_other { "\n" } else { whole }
    });
    Ok(Cow::Owned(kept.collect()))
}

/// Name and place of the first column whose name passes.
fn column(
    text: &str,
    layout: &TextLayout,
    passes: impl Fn(&str) -> bool,
) -> Option<(String, usize)> {
    let text = below("", text, layout.skip_rows).ok()?;
    let mut names = Row::default();
    RowReader::new(text, layout.delimiter, layout.decimal).read(&mut names);
    let mut names = names.cells.iter().map(|cell| String::from_utf8_lossy(&cell.text));
    let (index, name) = names.by_ref().enumerate().find(|(_, name)| passes(name.trim()))?;
    Some((name.trim().to_owned(), index))
}

/// Gives every row of values with its line, from 1.
fn rows(text: &str, layout: &TextLayout, mut take: impl FnMut(&Row, usize)) {
    let Ok(text) = below("", text, layout.skip_rows) else { return };
    let mut reader = RowReader::new(text, layout.delimiter, layout.decimal);
    let mut row = Row::default();
    let mut above = 1 + usize::from(layout.units_row);
    while reader.read(&mut row) {
        if above > 0 {
            above -= 1;
        } else {
            take(&row, layout.skip_rows + row.line);
        }
    }
}
