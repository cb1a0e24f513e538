//! Guesses about recordings that nobody described, corrected by the motion of the train.

use dynocar_core::plausibility::InputFault;
use dynocar_model::units::Unit;
use dynocar_shared::SampleField;

use super::facts::Facts;
use super::name::{Name, named_unit};
use super::plausible::{UnitChoice, choose_unit};
use crate::diagnostic::{Diagnostic, concerned};
use crate::{GradientSource, PositionSource, Quantity, Run, TextLayout, TimeFormat};

/// A recording's file.
#[derive(Clone, Copy, Debug)]
pub struct RecordingText<'t> {
    /// The file, as the user would find it.
    pub label: &'t str,
    /// Its text.
    pub text: &'t str,
}

/// A column's description by the user.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenColumn {
    /// Quantity of the column.
    pub quantity: Quantity,
    /// Its name in the header.
    pub column: String,
    /// Its unit; `None` where name and values must reveal it.
    pub unit: Option<Unit>,
    /// Format of its cells, where they are times and the user states it.
    pub format: Option<TimeFormat>,
}

/// The marks of files as the user states them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GivenMarks {
    /// Separator of the cells of a row; `None` where header and rows must reveal it.
    pub delimiter: Option<u8>,
    /// Separator of a number's fraction; `None` where the numbers must reveal it.
    pub decimal: Option<u8>,
}

impl GivenMarks {
    /// Returns the decimal mark, where one is stated or the delimiter leaves only one.
    pub(super) fn decimal(&self) -> Option<u8> {
        self.decimal.or(self.delimiter.filter(|it| *it == b'.').map(|_| b','))
    }
}

/// The description of recordings, as far as it can be guessed.
#[derive(Clone, Debug, PartialEq)]
pub struct Guess {
    /// How the text falls into cells; the encoding is as UTF-8 where nobody says another.
    pub layout: TextLayout,
    /// The columns that hold a quantity, in the order of [`Quantity::ALL`].
    pub columns: Vec<GuessedColumn>,
    /// The other columns, in the order of the header.
    pub unmapped: Vec<Unmapped>,
    /// The files, in the order given.
    pub runs: Vec<GuessedRun>,
}

/// A column and the quantity that it is taken for.
#[derive(Clone, Debug, PartialEq)]
pub struct GuessedColumn {
    /// Quantity of the column.
    pub quantity: Quantity,
    /// Its name in the header.
    pub name: Name,
    /// Further columns, which add up with it.
    pub parts: Vec<Name>,
    /// The unit of `cell * scale`.
    pub unit: Unit,
    /// Factor on the cell.
    pub scale: f64,
    /// How its cells are written, where they are times and no numbers.
    pub format: Option<TimeFormat>,
    /// Reasons for it.
    pub reasons: Vec<String>,
    /// Doubts about it; empty where header and values agree.
    pub doubts: Vec<String>,
    /// Rejected quantities of the column, and rejected columns of the quantity, each with the reason.
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

/// A file and its contents.
#[derive(Clone, Debug, PartialEq)]
pub struct GuessedRun {
    /// Rows of values.
    pub rows: usize,
    /// -1 where the position falls, else 1.
    pub direction: i8,
    /// The day in a column of dates that belongs to clock times, counted from 1970-01-01.
    pub day: Option<i64>,
}

impl Guess {
    /// Returns the guessed column of a quantity.
    pub fn column(&self, quantity: Quantity) -> Option<&GuessedColumn> {
        self.columns.iter().find(|column| column.quantity == quantity)
    }
}

impl GuessedColumn {
    /// Returns a column by its name and the facts on its values, in a unit that is given, or that its name states.
    pub(super) fn new(
        (name, facts): (&Name, &Facts),
        quantity: Quantity,
        reason: String,
        (given, named): (Option<Unit>, Option<Unit>),
    ) -> Self {
        let unit = match given {
            Some(unit) => {
                UnitChoice { unit, scale: 1.0, reason: "the unit as given".into(), doubt: None }
            }
            None => choose_unit(quantity, facts, named),
        };
        let guessed = GuessedColumn {
            quantity,
            name: name.clone(),
            parts: Vec::new(),
            unit: unit.unit,
            scale: unit.scale,
            format: None,
            reasons: vec![reason, unit.reason],
            doubts: unit.doubt.into_iter().collect(),
            rejected: Vec::new(),
            is_unit_open: given.is_none() && named_unit(name, quantity).is_none(),
            middle: facts.middle().unwrap_or(f64::NAN),
        };
        match (quantity, &facts.formats()[..]) {
            (Quantity::Time, [format, others @ ..]) => guessed.written_as(format, others),
            (Quantity::Time, []) if given.is_none() && guessed.is_unit_open => match facts.packed()
            {
                Some(format) => guessed.written_as(&format, &[]),
                None => guessed,
            },
            _ => guessed,
        }
    }

    /// Returns the same, its cells times in the format that is given.
    pub(super) fn given_as(self, format: Option<&TimeFormat>) -> Self {
        format.map_or(self.clone(), |format| self.written_as(format, &[]))
    }

    /// Returns the same, its cells times in a format; in others they could be, too.
    fn written_as(mut self, format: &TimeFormat, others: &[&TimeFormat]) -> Self {
        self.reasons[1] = format!("its cells are times as {}", format.example());
        // A day without a leading zero is read where one stands, too.
        let plain = |format: &TimeFormat| format.name().replace('-', "");
        let mut known = vec![plain(format)];
        let mut others: Vec<&str> = others.iter().map(|it| it.name()).collect();
        others.retain(|other| {
            let other = other.replace('-', "");
            let is_new = !known.contains(&other);
            known.push(other);
            is_new
        });
        let doubt = || format!("they could be {}, too", others.join(" or "));
        let doubts = (!others.is_empty()).then(doubt).into_iter().collect();
        let (unit, format) = (Unit::base_of(self.quantity.dimension()), Some(format.clone()));
        GuessedColumn { unit, scale: 1.0, format, doubts, is_unit_open: false, ..self }
    }
}

impl Guess {
    /// Changes the unit of one quantity whose unit no name gives, where the runs, read as guessed,
    /// cannot be true and another unit would explain it; `None` when nothing is to be changed.
    ///
    /// Where the train's mass is no more than a default or the gradient is unknown, forces are
    /// measured against nothing (a brake that holds a train on a descent slows nothing down): they
    /// and recorded masses stay as they are.
    pub fn correct<'r>(
        &mut self,
        runs: impl IntoIterator<Item = &'r Run>,
        is_mass_known: bool,
    ) -> Option<String> {
        let of_run = |run: &'r Run| run.diagnostics.iter().map(move |diagnostic| (run, diagnostic));
        for (run, diagnostic) in runs.into_iter().flat_map(of_run) {
            let Some((detected, read_as)) = diagnostic.fault else { continue };
            let is_measured = is_mass_known && run.gradient_source != GradientSource::Unknown;
            if needs_balance(detected.fault) && !is_measured {
                continue;
            }
            let Some(unit) = detected.true_unit(&read_as) else { continue };
            let (quantities, _) = concerned(detected.fault);
            let is_open = |quantity| {
                self.column(quantity).is_some_and(|it| it.is_unit_open && it.unit == read_as)
            };
            if !quantities.iter().any(|&quantity| is_open(quantity)) {
                continue;
            }
            let words = detected.words(&read_as);
            for column in &mut self.columns {
                if quantities.contains(&column.quantity) && column.is_unit_open {
                    column.unit = unit;
                    column.doubts = vec![format!(
                        "the name gives no unit; {}, since in {} {words}",
                        unit.name(),
                        read_as.name()
                    )];
                }
            }
            return Some(words);
        }
        None
    }
}

impl Guess {
    /// Turns the runs that go the other way by most steps from one time to the next, where the files have the rows in
    /// another order, and those without a position that speed up where the recorded gradient climbs, which leaves a
    /// doubt; true where any was turned.
    pub fn turn_runs<'r>(&mut self, runs: impl IntoIterator<Item = &'r Run>) -> bool {
        let mut is_turned = false;
        for (guessed, run) in self.runs.iter_mut().zip(runs) {
            let is_against = |it: &Diagnostic| {
                it.fault.is_some_and(|(it, _)| it.fault == InputFault::GradientSign)
            };
            if run.position_source != PositionSource::Column
                && run.gradient_source == GradientSource::Column
                && guessed.direction == 1
                && run.diagnostics.iter().any(is_against)
            {
                guessed.direction = -1;
                is_turned = true;
                let gradient = self.columns.iter_mut().find(|it| it.quantity == Quantity::Gradient);
                gradient.into_iter().for_each(|it| {
                    it.doubts.push(format!(
                        "{} has no position and speeds up where it climbs: taken to go against the chainage \
                         (direction = -1)",
                        run.file
                    ));
                });
            }
            let positions: Vec<f64> =
                run.samples.iter().filter_map(|it| it.get(SampleField::Position)).collect();
            let signs = positions.windows(2).map(|it| (it[1] - it[0]).partial_cmp(&0.0));
            let balance: i64 = signs.map(|it| it.map_or(0, |it| it as i64)).sum();
            let direction = if balance < 0 { -1 } else { 1 };
            if run.position_source == PositionSource::Column && guessed.direction != direction {
                guessed.direction = direction;
                is_turned = true;
            }
        }
        is_turned
    }
}

/// Returns true for a fault that only the balance of forces shows.
fn needs_balance(fault: InputFault) -> bool {
    matches!(
        fault,
        InputFault::MassScale
            | InputFault::ForcesScale
            | InputFault::TractionScale
            | InputFault::BrakeScale
    )
}
