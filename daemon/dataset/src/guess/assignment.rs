//! Which column is taken for which quantity.

use std::cmp::Reverse;

use super::columns::{Column, Columns};
use super::facts::Facts;
use super::guessed::{GivenColumn, GuessResult, GuessedColumn, Unmapped};
use super::matching::{Candidate, can_hold, consider, named_unit};
use super::plausible::{UnitChoice, choose_unit};
use super::problem::{GuessError, GuessProblem};
use super::spelling::Spelled;
use crate::{Quantity, SourcePosition};

/// What the columns are taken for.
pub struct Assignment<'c> {
    columns: &'c [Column],
    /// Column and what it is taken for, or rather not: with the reason.
    taken: Vec<(usize, GuessedColumn, bool)>,
    dropped: Vec<(usize, String)>,
    candidates: Vec<Candidate>,
    refused: Vec<(usize, Quantity, String)>,
}

impl<'c> Assignment<'c> {
    /// Takes what is declared for granted, and for every other quantity the column that most speaks for.
    ///
    /// # Errors
    ///
    /// Where what is declared cannot be.
    pub fn new(columns: &'c Columns, given: &[GivenColumn], label: &str) -> GuessResult<Self> {
        let mut assignment = Assignment {
            columns: &columns.columns,
            taken: Vec::new(),
            dropped: Vec::new(),
            candidates: Vec::new(),
            refused: Vec::new(),
        };
        for it in given {
            let problem = assignment.take_given(it, columns);
            let place = || SourcePosition::line(label, columns.skip_rows + 1);
            problem.map_err(|problem| GuessError::new(place(), problem))?;
        }
        for (index, column) in columns.columns.iter().enumerate() {
            if column.unusable.is_some() || assignment.is_taken(index) {
                continue;
            }
            for quantity in Quantity::ALL.into_iter().filter(|it| !is_given(given, *it)) {
                match consider(index, &column.name, &column.all, quantity) {
                    None => {}
                    Some(Ok(candidate)) => assignment.candidates.push(candidate),
                    Some(Err(reason)) => assignment.refused.push((index, quantity, reason)),
                }
            }
        }
        assignment.take_best();
        Ok(assignment)
    }

    fn take_given(&mut self, given: &GivenColumn, columns: &Columns) -> Result<(), GuessProblem> {
        let (name, quantity) = (given.column.clone(), given.quantity);
        let index = self.columns.iter().position(|column| column.name.text == given.column.trim());
        let Some(index) = index else {
            return Err(GuessProblem::NoSuchColumn { name, quantity, columns: columns.names() });
        };
        let column = &self.columns[index];
        let reason = match &column.unusable {
            Some(reason) => Err(reason.clone()),
            None => can_hold(&column.all, quantity),
        };
        if let Err(reason) = reason {
            return Err(GuessProblem::Unfit { name, quantity, reason });
        }
        let unit = match given.unit {
            Some(unit) => UnitChoice {
                spelled: Spelled { unit, scale: 1.0 },
                reason: "the unit as given".into(),
                doubt: None,
            },
            None => choose_unit(quantity, &column.all, named_unit(&column.name, quantity)),
        };
        let is_unit_open = given.unit.is_none() && named_unit(&column.name, quantity).is_none();
        let mut guessed = self.guessed(index, quantity, unit);
        guessed.reasons.insert(0, "given on the command line".into());
        guessed.is_unit_open = is_unit_open && guessed.format.is_none();
        self.taken.push((index, guessed, true));
        Ok(())
    }

    fn guessed(&self, index: usize, quantity: Quantity, unit: UnitChoice) -> GuessedColumn {
        let column = &self.columns[index];
        let middle = column.all.middle().unwrap_or(f64::NAN);
        let guessed = GuessedColumn::new(quantity, column.name.clone(), unit, middle);
        match quantity {
            Quantity::Time => guessed.written_as(&column.all.formats()),
            _ => guessed,
        }
    }

    /// The best candidate first, then the best of those that are left.
    fn take_best(&mut self) {
        let mut candidates = self.candidates.clone();
        candidates.sort_by_key(|it| (Reverse(it.score), it.quantity, it.column));
        for Candidate { column, quantity, reason, unit, doubt, .. } in candidates {
            if self.is_taken(column) || self.has(quantity) {
                continue;
            }
            let is_unit_open = named_unit(&self.columns[column].name, quantity).is_none();
            let mut guessed = self.guessed(column, quantity, unit);
            guessed.reasons.insert(0, reason);
            guessed.doubts.splice(0..0, doubt);
            guessed.is_unit_open = is_unit_open && guessed.format.is_none();
            self.taken.push((column, guessed, false));
        }
    }

    fn is_taken(&self, index: usize) -> bool {
        self.taken.iter().any(|(other, ..)| *other == index)
    }

    /// True where a column is taken for the quantity.
    pub fn has(&self, quantity: Quantity) -> bool {
        self.taken.iter().any(|(_, guessed, _)| guessed.quantity == quantity)
    }

    /// What the values are like of the column that is taken for a quantity.
    pub fn facts(&self, quantity: Quantity) -> Option<&'c Facts> {
        let found = self.taken.iter().find(|(_, guessed, _)| guessed.quantity == quantity);
        found.map(|(index, ..)| &self.columns[*index].all)
    }

    /// Takes a quantity's column for another quantity instead, with a doubt; what was declared stays.
    pub fn rename(&mut self, from: Quantity, to: Quantity, doubt: &str) {
        for (_, guessed, is_given_here) in &mut self.taken {
            if guessed.quantity == from && !*is_given_here {
                guessed.quantity = to;
                guessed.doubts.insert(0, doubt.into());
                guessed.rejected.push(format!("not {from}: {doubt}"));
            }
        }
    }

    /// Takes a quantity's column for nothing; what was declared stays.
    pub fn drop(&mut self, quantity: Quantity, reason: &str) {
        let is_it = |guessed: &GuessedColumn| guessed.quantity == quantity;
        let left_out = self.taken.extract_if(.., |(_, guessed, given)| is_it(guessed) && !*given);
        let left_out = left_out.map(|(index, ..)| (index, format!("not {quantity}: {reason}")));
        self.dropped.extend(left_out);
    }

    /// Turns the sign of a quantity.
    pub fn turn(&mut self, quantity: Quantity, reason: &str) {
        for (_, guessed, _) in &mut self.taken {
            if guessed.quantity == quantity {
                guessed.scale = -guessed.scale;
                guessed.reasons.push(reason.into());
            }
        }
    }

    /// What comes near a quantity that no column is taken for, each with the reason.
    pub fn near(&self, quantity: Quantity) -> Vec<String> {
        let of_it = self.refused.iter().filter(|(_, of, _)| *of == quantity);
        of_it.map(|(index, _, reason)| format!("'{}': {reason}", self.shown(*index))).collect()
    }

    fn shown(&self, index: usize) -> String {
        self.columns[index].name.shown()
    }

    /// The columns that hold a quantity, with what was not taken for it, and the others.
    pub fn finish(mut self) -> (Vec<GuessedColumn>, Vec<Unmapped>) {
        for place in 0..self.taken.len() {
            let more = self.not_taken(self.taken[place].0, self.taken[place].1.quantity);
            self.taken[place].1.rejected.extend(more);
        }
        let left = (0..self.columns.len()).filter(|index| !self.is_taken(*index));
        let unmapped = left.map(|index| self.unmapped(index)).collect();
        let mut columns: Vec<_> = self.taken.into_iter().map(|(_, guessed, _)| guessed).collect();
        columns.sort_by_key(|column| column.quantity);
        (columns, unmapped)
    }

    /// What a column was not taken for, and which columns were not taken for its quantity.
    fn not_taken(&self, index: usize, quantity: Quantity) -> Vec<String> {
        let others = self.candidates.iter().filter(|it| it.column == index);
        let others = others
            .filter(|it| it.quantity != quantity)
            .map(|it| format!("not {}, for which less speaks ({})", it.quantity, it.reason));
        let refused = self.refused.iter().filter(|(of, ..)| *of == index);
        let refused = refused.map(|(_, quantity, reason)| format!("not {quantity}: {reason}"));
        let columns = self.candidates.iter().filter(|it| it.quantity == quantity);
        let columns = columns
            .filter(|it| it.column != index && !self.is_taken(it.column))
            .map(|it| format!("'{}' could be it, too ({})", self.shown(it.column), it.reason));
        others.chain(refused).chain(columns).chain(self.near(quantity)).collect()
    }

    fn unmapped(&self, index: usize) -> Unmapped {
        let column = &self.columns[index];
        let dropped = self.dropped.iter().find(|(of, _)| *of == index);
        let candidate = self.candidates.iter().find(|it| it.column == index);
        let refused = self.refused.iter().find(|(of, ..)| *of == index);
        let reason = match (&column.unusable, dropped, candidate, refused) {
            (Some(reason), ..) => reason.clone(),
            (_, Some((_, reason)), ..) => reason.clone(),
            (_, _, Some(it), _) => {
                let taken = self.taken.iter().find(|(_, other, _)| other.quantity == it.quantity);
                let by = taken.map_or_else(String::new, |(_, other, _)| {
                    format!(", for which '{}' is taken", other.name.shown())
                });
                format!("could be {}{by}", it.quantity)
            }
            (.., Some((_, quantity, reason))) => format!("not {quantity}: {reason}"),
            _ => "its name says none of the quantities".into(),
        };
        Unmapped { name: column.name.clone(), reason }
    }
}

fn is_given(given: &[GivenColumn], quantity: Quantity) -> bool {
    given.iter().any(|it| it.quantity == quantity)
}
