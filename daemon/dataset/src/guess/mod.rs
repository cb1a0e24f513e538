//! A description of recordings that nobody has described yet: the quantity and the unit of each column.
//!
//! Names give the quantity, names or values the unit. Nothing is assumed silently: every guess states its reasons, its
//! doubts and the rejected alternatives; a column without any sign of a quantity is left out. The motion of trains
//! ([`Guess::correct`]) decides last about a unit that no name gives.
//!
//! # Layout, in the order of the work
//!
//! - `layout`, `columns`, `facts`: delimiter, marks in numbers, names and units; facts on the values
//! - `name`: a name in words, units as people write them, recorders' names of the quantities
//! - `matching`, `plausible`: the score of a column for each quantity, and its likeliest unit
//! - `assignment`: one column for each quantity
//! - [`guessed`]: the guess, and its correction

mod assignment;
mod columns;
mod facts;
pub mod guessed;
mod layout;
mod matching;
mod name;
mod plausible;

#[cfg(test)]
mod tests;

pub use guessed::{
    GivenColumn, GivenMarks, Guess, GuessedColumn, GuessedRun, RecordingText, Unmapped,
};
pub use layout::{GuessedLayout, layout, shown_mark};
pub use name::Name;

use dynocar_model::units::Unit;

use super::{DatasetError, Quantity, SourcePosition};
use assignment::Assignment;

/// A force with more than this share of values below zero is signed.
const SIGNED_SHARE: f64 = 0.02;

/// Guesses the description of recordings with the same layout; declared columns and marks stay as given.
///
/// # Errors
///
/// If a file cannot be part of a dataset, or holds no time or no speed that can be recognised; with file, line and
/// the expected contents.
pub fn guess(
    files: &[RecordingText],
    given: &[GivenColumn],
    marks: GivenMarks,
) -> Result<Guess, DatasetError> {
    let read = columns::InspectedColumns::read(files, marks)?;
    let label = files.first().map_or("", |file| file.label);
    let mut assignment = Assignment::new(&read, given, label)?;
    settle(&mut assignment);
    assignment.weigh_positions();
    let at_names = || SourcePosition::line(label, read.layout.text.skip_rows + 1);
    if let Some((column, quantity, reason)) = assignment.unknown_unit() {
        let name = column.name.shown();
        return Err(at_names().problem(format!(
            "column '{name}' looks like {quantity}, but {reason}: say its unit: --column \
             {quantity}=COLUMN:UNIT, or that it is something else by another name; the units: {}",
            unit_names(quantity)
        )));
    }
    for quantity in [Quantity::Time, Quantity::Speed] {
        if !assignment.has(quantity) {
            let mut near = assignment.near(quantity);
            // Columns of one name are refused for one reason.
            near.dedup();
            let near = match near.join("; ") {
                none if none.is_empty() => none,
                near => format!(" ({near})"),
            };
            let grows = if quantity == Quantity::Time {
                " or time=COLUMN:FORMAT, as %d.%m.%Y %H:%M:%S"
            } else {
                ""
            };
            return Err(at_names().problem(format!(
                "no column was recognised as {quantity}{near}; the columns: {}; say which it is: \
                 --column {quantity}=COLUMN:UNIT{grows}",
                read.names()
            )));
        }
    }
    let (columns, unmapped) = assignment.finish();
    let guessed = |quantity| columns.iter().find(|column| column.quantity == quantity);
    let position = guessed(Quantity::Position)
        .and_then(|it| read.columns.iter().find(|column| column.name == it.name));
    let format = guessed(Quantity::Time).and_then(|it| it.format.as_ref());
    let lacks_date = format.is_some_and(|it| !it.has_date());
    let dates = read.columns.iter().filter(|_| lacks_date);
    let runs = read.rows.iter().enumerate().map(|(index, &rows)| GuessedRun {
        rows,
        direction: position.map_or(1, |column| column.facts[index].direction()),
        day: dates.clone().find_map(|column| column.facts[index].day),
    });
    let runs = runs.collect();
    Ok(Guess { layout: read.layout.text, columns, unmapped, runs })
}

fn unit_names(quantity: Quantity) -> String {
    let names: Vec<&str> = Unit::of(quantity.dimension()).map(|unit| unit.name()).collect();
    names.join(", ")
}

/// Resolves pairs that a dataset cannot have: a signed force and one that is never negative, a handle and a force.
fn settle(assignment: &mut Assignment) {
    use Quantity::{BrakeForce, BrakeHandle, ControlForce, TractionForce, TractionHandle};
    let is_signed = |assignment: &Assignment, quantity| {
        let signs = assignment.facts(quantity).map(|facts| facts.signs());
        signs.is_some_and(|(up, down)| up > SIGNED_SHARE && down > SIGNED_SHARE)
    };
    if is_signed(assignment, TractionForce)
        && !assignment.has(BrakeForce)
        && !assignment.has(ControlForce)
    {
        let doubt = "its values have both signs: taken for traction minus brake force";
        assignment.rename(TractionForce, ControlForce, doubt);
    }
    let has_both = assignment.has(TractionForce) || assignment.has(BrakeForce);
    if assignment.has(ControlForce) && has_both {
        if assignment.has(TractionForce) {
            assignment.drop(ControlForce, "traction_force is recorded by itself");
        } else if is_signed(assignment, ControlForce) {
            assignment.drop(BrakeForce, "control_force holds the brake force already");
        }
    }
    if assignment.has(ControlForce) && !is_signed(assignment, ControlForce) {
        let doubt = "its values have one sign: taken for the traction force alone";
        assignment.rename(ControlForce, TractionForce, doubt);
    }
    let turned = assignment.facts(BrakeForce).map(|facts| facts.signs());
    if turned.is_some_and(|(up, down)| down > up) {
        let scale = super::keys::column::SCALE.assign(-1);
        assignment.turn(BrakeForce, &format!("its values are negative while it brakes: {scale}"));
    }
    let has_control = assignment.has(ControlForce);
    for (handle, force) in [(TractionHandle, TractionForce), (BrakeHandle, BrakeForce)] {
        if assignment.has(force) || has_control {
            assignment.drop(handle, "the force itself is recorded");
        } else {
            let reason = "a handle is a share of an effort curve, which train.toml must declare \
                          first ([traction] or [brake] effort)";
            assignment.drop(handle, reason);
        }
    }
}
