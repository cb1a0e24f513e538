//! What was guessed of recordings that nobody described.

use dynocar_model::units::Unit;

use super::name::Name;
use super::plausible::UnitChoice;
use super::problem::GuessError;
use crate::{Quantity, TimeFormat};

/// A recording's file.
#[derive(Clone, Copy, Debug)]
pub struct Recording<'t> {
    /// The file, as the user would find it.
    pub label: &'t str,
    /// Its text.
    pub text: &'t str,
}

/// What somebody says of a column.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenColumn {
    /// What it holds.
    pub quantity: Quantity,
    /// Its name in the header.
    pub column: String,
    /// Its unit; `None` where name and values are to reveal it.
    pub unit: Option<Unit>,
}

/// The description of recordings, as far as it can be guessed.
#[derive(Clone, Debug, PartialEq)]
pub struct Guess {
    /// Between the cells of a row.
    pub delimiter: u8,
    /// Between a number and its fraction.
    pub decimal: u8,
    /// Lines above the names.
    pub skip_rows: usize,
    /// True where a line of units stands below the names.
    pub units_row: bool,
    /// The columns that hold a quantity, in the order of [`Quantity::ALL`].
    pub columns: Vec<GuessedColumn>,
    /// The other columns, in the order of the header.
    pub unmapped: Vec<Unmapped>,
    /// The files, in the order given.
    pub runs: Vec<GuessedRun>,
}

/// A column and what it is taken for.
#[derive(Clone, Debug, PartialEq)]
pub struct GuessedColumn {
    /// What it holds.
    pub quantity: Quantity,
    /// Its name in the header.
    pub name: Name,
    /// The unit of `cell * scale`.
    pub unit: Unit,
    /// Factor on the cell.
    pub scale: f64,
    /// How its cells are written, where they are times and no numbers.
    pub format: Option<TimeFormat>,
    /// What speaks for it.
    pub reasons: Vec<String>,
    /// What makes it doubtful; empty where header and values agree.
    pub doubts: Vec<String>,
    /// What it was not taken for, and what was not taken for it, each with the reason.
    pub rejected: Vec<String>,
    /// True where the name gives no unit, so that the values reveal it.
    pub is_unit_open: bool,
    /// The middle of its values, in the file's numbers.
    pub middle: f64,
}

/// A column that holds nothing that a dataset knows, as far as one can see.
#[derive(Clone, Debug, PartialEq)]
pub struct Unmapped {
    /// Its name in the header.
    pub name: Name,
    /// Why it is left out.
    pub reason: String,
}

/// A file and what it holds.
#[derive(Clone, Debug, PartialEq)]
pub struct GuessedRun {
    /// The file, as the user would find it.
    pub label: String,
    /// Rows of values.
    pub rows: usize,
    /// -1 where the position falls, else 1.
    pub direction: i8,
    /// The day in a column of dates beside clock times, counted from 1970-01-01.
    pub day: Option<i64>,
}

impl Guess {
    /// What a quantity was guessed to be.
    pub fn column(&self, quantity: Quantity) -> Option<&GuessedColumn> {
        self.columns.iter().find(|column| column.quantity == quantity)
    }
}

impl GuessedColumn {
    /// A column with a unit and without a doubt.
    pub(super) fn new(quantity: Quantity, name: Name, unit: UnitChoice, middle: f64) -> Self {
        GuessedColumn {
            quantity,
            name,
            unit: unit.spelled.unit,
            scale: unit.spelled.scale,
            format: None,
            reasons: vec![unit.reason],
            doubts: unit.doubt.into_iter().collect(),
            rejected: Vec::new(),
            is_unit_open: false,
            middle,
        }
    }

    /// The same, its cells times in the first of these formats; in the others they could be, too.
    pub(super) fn written_as(self, formats: &[&TimeFormat]) -> Self {
        let [format, others @ ..] = formats else { return self };
        let unit = Unit::base_of(self.quantity.dimension());
        let reason = format!("its cells are times as {}", format.example());
        let names: Vec<&str> = others.iter().map(|it| it.name()).collect();
        // A day without a leading zero is read where one stands, too.
        let is_other = |name: &str| name.replace('-', "") != format.name().replace('-', "");
        let others: Vec<&str> = names.into_iter().filter(|name| is_other(name)).collect();
        let doubt = format!("they could be {}, too", others.join(" or "));
        let doubts = if others.is_empty() { Vec::new() } else { vec![doubt] };
        let format = Some((*format).clone());
        GuessedColumn { unit, scale: 1.0, format, reasons: vec![reason], doubts, ..self }
    }
}

/// A guess, or why there is none.
pub type GuessResult<T> = Result<T, GuessError>;
