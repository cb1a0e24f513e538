//! What was guessed of recordings that nobody described.

use dynocar_core::units::Unit;

use super::name::Name;
use super::plausible::UnitChoice;
use super::problem::GuessError;
use crate::dataset::Quantity;

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
pub struct Told {
    /// What it holds.
    pub quantity: Quantity,
    /// Its name in the header.
    pub column: String,
    /// Its unit; `None` where name and values are to tell it.
    pub unit: Option<Unit>,
}

/// The description of recordings, as far as it can be guessed.
#[derive(Clone, Debug, PartialEq)]
pub struct Guess {
    /// Between the cells of a row.
    pub delimiter: u8,
    /// Between a number and its fraction.
    pub decimal: u8,
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
    /// What speaks for it.
    pub reasons: Vec<String>,
    /// What makes it doubtful; empty where header and values agree.
    pub doubts: Vec<String>,
    /// What it was not taken for, and what was not taken for it, each with the reason.
    pub rejected: Vec<String>,
    /// True where the name gives no unit, so that the values tell it.
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
            reasons: vec![unit.reason],
            doubts: unit.doubt.into_iter().collect(),
            rejected: Vec::new(),
            is_unit_open: false,
            middle,
        }
    }
}

/// A guess, or why there is none.
pub type GuessResult<T> = Result<T, GuessError>;
