//! Assignment of columns to quantities, and its corrections by the columns' values: a position's span, the signs of
//! forces.

use std::cmp::Reverse;

use dynocar_model::units::Unit;

use super::columns::{InspectedColumn, InspectedColumns};
use super::facts::Facts;
use super::guessed::{GivenColumn, GuessedColumn, Unmapped};
use super::matching::{UNKNOWN_UNIT, are_alike, can_hold, consider, figures};
use super::name::named_unit;
use crate::error::unknown;
use crate::{DatasetError, Quantity, SourcePosition};

/// Logarithm of the ratio of a position's span to the integrated speed that gaps and wear explain.
const SPAN_MISFIT: f64 = 0.2;
/// Greatest difference between the scores of two columns that could both be the quantity.
const NEAR: i32 = 25;

/// A column that may hold a quantity.
#[derive(Clone)]
struct Candidate {
    /// Index of the column.
    column: usize,
    /// Score; a greater one is likelier.
    score: i32,
    /// Guessed column; the first reason is the word in the name that indicates the quantity.
    guessed: GuessedColumn,
}

/// A column that is assigned.
#[derive(Clone)]
struct AssignedColumn {
    index: usize,
    guessed: GuessedColumn,
    /// Given on the command line.
    is_given: bool,
}

/// A column that a quantity refuses.
struct RefusedColumn {
    index: usize,
    quantity: Quantity,
    reason: String,
}

/// Assignment of columns to quantities.
pub struct Assignment<'c> {
    columns: &'c [InspectedColumn],
    taken: Vec<AssignedColumn>,
    dropped: Vec<(usize, String)>,
    candidates: Vec<Candidate>,
    refused: Vec<RefusedColumn>,
}

impl<'c> Assignment<'c> {
    /// Assigns the declared columns as given, and to every other quantity the column with the best score.
    ///
    /// # Errors
    ///
    /// When a declared column cannot hold its quantity.
    pub fn new(
        columns: &'c InspectedColumns,
        given: &[GivenColumn],
        label: &str,
    ) -> Result<Self, DatasetError> {
        let mut assignment = Assignment {
            columns: &columns.columns,
            taken: Vec::new(),
            dropped: Vec::new(),
            candidates: Vec::new(),
            refused: Vec::new(),
        };
        for (number, it) in given.iter().enumerate() {
            let twice = given[..number].iter().find(|other| other.quantity == it.quantity);
            if let Some(other) = twice {
                let (quantity, one, two) = (it.quantity, &other.column, &it.column);
                let words = format!("{quantity} is given twice: as column '{one}' and as '{two}'");
                return Err(SourcePosition::whole(label).problem(words));
            }
            let place = || SourcePosition::line(label, columns.layout.text.skip_rows + 1);
            assignment.take_given(it, columns).map_err(|words| place().problem(words))?;
        }
        for (index, column) in columns.columns.iter().enumerate() {
            if assignment.is_taken(index) {
                continue;
            }
            let is_given = |quantity: &Quantity| given.iter().any(|it| it.quantity == *quantity);
            for quantity in Quantity::ALL.into_iter().filter(|it| !is_given(it)) {
                let mut refuse = |reason: String| {
                    assignment.refused.push(RefusedColumn { index, quantity, reason });
                };
                match (consider(&column.name, &column.all, quantity), &column.unusable) {
                    (None, _) => {}
                    (Some(_), Some(reason)) => refuse(reason.clone()),
                    (Some(found), None) => match found {
                        Ok((score, guessed)) => {
                            assignment.candidates.push(Candidate { column: index, score, guessed });
                        }
                        Err(reason) => refuse(reason),
                    },
                }
            }
        }
        assignment.take_best();
        assignment.weigh_others();
        Ok(assignment)
    }

    fn take_given(
        &mut self,
        given: &GivenColumn,
        columns: &InspectedColumns,
    ) -> Result<(), String> {
        let (name, quantity) = (&given.column, given.quantity);
        let index = self.columns.iter().position(|column| column.name.text == given.column.trim());
        let Some(index) = index else {
            let is_column = |name: &str| self.columns.iter().any(|it| it.name.text == name.trim());
            if let Some((_, unit)) = name.rsplit_once(':').filter(|it| is_column(it.0)) {
                let units = Unit::of(quantity.dimension()).map(|it| it.name());
                return Err(unknown("unit", unit, &format!(" for {quantity}"), units));
            }
            let names = columns.names();
            return Err(format!("no column '{name}' for {quantity}; the columns: {names}"));
        };
        let column = &self.columns[index];
        let reason = match &column.unusable {
            // How its cells are to be read is said.
            _ if given.format.is_some() => Ok(()),
            Some(reason) => Err(reason.clone()),
            None => can_hold(&column.all, quantity),
        };
        if let Err(reason) = reason {
            return Err(format!("column '{name}' cannot be {quantity}: {reason}"));
        }
        let unit = (given.unit, named_unit(&column.name, quantity));
        let reason = "given on the command line".into();
        let guessed = GuessedColumn::new((&column.name, &column.all), quantity, reason, unit);
        let guessed = guessed.given_as(given.format.as_ref());
        self.taken.push(AssignedColumn { index, guessed, is_given: true });
        Ok(())
    }

    /// The best candidate first, then the best of those that are left.
    fn take_best(&mut self) {
        let mut candidates = self.candidates.clone();
        candidates.sort_by_key(|it| (Reverse(it.score), it.guessed.quantity, it.column));
        for Candidate { column, guessed, .. } in candidates {
            if !self.is_taken(column) && !self.has(guessed.quantity) {
                self.taken.push(AssignedColumn { index: column, guessed, is_given: false });
            }
        }
    }

    /// Takes columns as parts that add up where their names differ only in the number of the part, and adds a doubt
    /// where another column could be the quantity as well.
    fn weigh_others(&mut self) {
        for place in 0..self.taken.len() {
            let AssignedColumn { index, guessed, is_given } = &self.taken[place];
            if *is_given {
                continue;
            }
            let (quantity, column) = (guessed.quantity, &self.columns[*index]);
            let own_score = self.score(*index, quantity);
            let others = self.candidates.iter().filter(|it| {
                it.guessed.quantity == quantity && it.column != *index && !self.is_taken(it.column)
            });
            let is_part = |it: &&Candidate| {
                let other = &self.columns[it.column].name;
                quantity.adds_up()
                    && column.name.without_number().is_some()
                    && other.without_number() == column.name.without_number()
                    && other.unit == column.name.unit
            };
            let (parts, others): (Vec<&Candidate>, Vec<&Candidate>) = others.partition(is_part);
            let mut parts: Vec<usize> = parts.iter().map(|it| it.column).collect();
            parts.sort_unstable();
            let own = figures(&column.all, guessed);
            let is_near = |it: &&&Candidate| {
                let other = figures(&self.columns[it.column].all, &it.guessed);
                it.score + NEAR >= own_score && !are_alike(own, other)
            };
            let near: Vec<String> = others
                .iter()
                .filter(is_near)
                .map(|it| format!("'{}' could be it as well", self.shown(it.column)))
                .collect();
            let mut doubts = Vec::new();
            if !parts.is_empty() {
                let names: Vec<String> = std::iter::once(index)
                    .chain(&parts)
                    .map(|&index| format!("'{}'", self.shown(index)))
                    .collect();
                doubts.push(format!("{} are taken for parts that add up", names.join(", ")));
            }
            doubts.extend(near);
            let parts = parts.iter().map(|&part| self.columns[part].name.clone()).collect();
            let guessed = &mut self.taken[place].guessed;
            guessed.parts = parts;
            guessed.doubts.extend(doubts);
        }
    }

    fn score(&self, index: usize, quantity: Quantity) -> i32 {
        let is_it = |it: &&Candidate| it.column == index && it.guessed.quantity == quantity;
        self.candidates.iter().find(is_it).map_or(0, |it| it.score)
    }

    /// Returns the first column that would be a quantity that nothing is taken for, were its unit known.
    pub fn unknown_unit(&self) -> Option<(&'c InspectedColumn, Quantity, &str)> {
        let refused = self.refused.iter().find(|it| {
            it.reason.starts_with(UNKNOWN_UNIT)
                && !self.has(it.quantity)
                && !self.is_taken(it.index)
                && self.columns[it.index].all.formats().is_empty()
        });
        refused.map(|it| (&self.columns[it.index], it.quantity, it.reason.as_str()))
    }

    fn is_part(&self, index: usize) -> bool {
        let name = &self.columns[index].name;
        self.taken.iter().any(|it| it.guessed.parts.contains(name))
    }

    fn is_taken(&self, index: usize) -> bool {
        self.taken.iter().any(|it| it.index == index)
    }

    fn taken_for(&self, quantity: Quantity) -> Option<&AssignedColumn> {
        self.taken.iter().find(|it| it.guessed.quantity == quantity)
    }

    /// Returns whether a column is taken for the quantity.
    pub fn has(&self, quantity: Quantity) -> bool {
        self.taken_for(quantity).is_some()
    }

    /// Returns the facts on the values of the column assigned to a quantity.
    pub fn facts(&self, quantity: Quantity) -> Option<&'c Facts> {
        self.taken_for(quantity).map(|it| &self.columns[it.index].all)
    }

    /// Takes as position the column whose span fits the integrated speed, where the column with the better name does
    /// not fit.
    pub fn weigh_positions(&mut self) {
        let Some(taken) = self.taken_for(Quantity::Position).filter(|it| !it.is_given).cloned()
        else {
            return;
        };
        let Some(time) = self.taken_for(Quantity::Time) else { return };
        let Some(speed) = self.taken_for(Quantity::Speed) else { return };
        let facts = |column: usize| &self.columns[column].facts;
        let base =
            |guessed: &GuessedColumn, value: f64| guessed.unit.to_base(value * guessed.scale);
        // Times that are no numbers are in s already.
        let driven_m: f64 = facts(time.index)
            .iter()
            .zip(facts(speed.index))
            .filter_map(|(times, speeds)| {
                Some(base(&time.guessed, times.span()?) * base(&speed.guessed, speeds.mean()?))
            })
            .sum();
        let misfit = |column: usize, guessed: &GuessedColumn| {
            let spans = facts(column).iter().filter_map(Facts::span);
            (spans.map(|span| base(guessed, span)).sum::<f64>() / driven_m).ln().abs()
        };
        let own = misfit(taken.index, &taken.guessed);
        let others = self
            .candidates
            .iter()
            .filter(|it| it.guessed.quantity == Quantity::Position && !self.is_taken(it.column));
        let best = others
            .map(|it| (misfit(it.column, &it.guessed), it))
            .filter(|(misfit, _)| *misfit < SPAN_MISFIT && own > 2.0 * SPAN_MISFIT)
            .min_by(|one, other| one.0.total_cmp(&other.0));
        let Some((_, best)) = best else { return };
        let (index, mut guessed) = (best.column, best.guessed.clone());
        guessed.reasons.push(format!(
            "it spans what the speed says, which '{}' does not",
            self.shown(taken.index)
        ));
        self.taken.retain(|it| it.guessed.quantity != Quantity::Position);
        self.taken.push(AssignedColumn { index, guessed, is_given: false });
    }

    /// Takes a quantity's column for another quantity instead, with a doubt; a declared column stays.
    pub fn rename(&mut self, from: Quantity, to: Quantity, doubt: &str) {
        for AssignedColumn { guessed, is_given, .. } in &mut self.taken {
            if guessed.quantity == from && !*is_given {
                guessed.quantity = to;
                guessed.doubts.insert(0, doubt.into());
                guessed.rejected.push(format!("not {from}: {doubt}"));
            }
        }
    }

    /// Drops a quantity's column; a declared column stays.
    pub fn drop(&mut self, quantity: Quantity, reason: &str) {
        let is_it = |it: &mut AssignedColumn| it.guessed.quantity == quantity && !it.is_given;
        let left_out = self.taken.extract_if(.., is_it);
        let left_out = left_out.map(|it| (it.index, format!("not {quantity}: {reason}")));
        self.dropped.extend(left_out);
    }

    /// Turns the sign of a quantity.
    pub fn turn(&mut self, quantity: Quantity, reason: &str) {
        for AssignedColumn { guessed, .. } in &mut self.taken {
            if guessed.quantity == quantity {
                guessed.scale = -guessed.scale;
                guessed.reasons.push(reason.into());
            }
        }
    }

    /// Returns the columns that come near a quantity without an assigned column, each with the reason.
    pub fn near(&self, quantity: Quantity) -> Vec<String> {
        let of_it = self.refused.iter().filter(|it| it.quantity == quantity);
        of_it.map(|it| format!("'{}': {}", self.shown(it.index), it.reason)).collect()
    }

    fn shown(&self, index: usize) -> String {
        self.columns[index].name.shown()
    }

    /// Returns the columns that hold a quantity, each with the alternatives that were rejected, and the other columns.
    pub fn finish(mut self) -> (Vec<GuessedColumn>, Vec<Unmapped>) {
        for place in 0..self.taken.len() {
            let more = self.not_taken(self.taken[place].index, self.taken[place].guessed.quantity);
            self.taken[place].guessed.rejected.extend(more);
        }
        let left =
            (0..self.columns.len()).filter(|index| !self.is_taken(*index) && !self.is_part(*index));
        let unmapped = left.map(|index| self.unmapped(index)).collect();
        let mut columns: Vec<_> = self.taken.into_iter().map(|it| it.guessed).collect();
        columns.sort_by_key(|column| column.quantity);
        (columns, unmapped)
    }

    /// Returns the quantities that a column was not assigned to, and the columns that were not assigned to its
    /// quantity.
    fn not_taken(&self, index: usize, quantity: Quantity) -> Vec<String> {
        let others = self.candidates.iter().filter(|it| it.column == index);
        let others = others.map(|it| &it.guessed).filter(|it| it.quantity != quantity);
        let others = others
            .map(|it| format!("not {}, for which less speaks ({})", it.quantity, it.reasons[0]));
        let refused = self.refused.iter().filter(|it| it.index == index);
        let refused = refused.map(|it| format!("not {}: {}", it.quantity, it.reason));
        let columns = self.candidates.iter().filter(|it| it.guessed.quantity == quantity);
        let columns = columns.filter(|it| it.column != index && !self.is_taken(it.column));
        let columns = columns.map(|Candidate { column, guessed, .. }| {
            format!("'{}' could be it, too ({})", self.shown(*column), guessed.reasons[0])
        });
        others.chain(refused).chain(columns).chain(self.near(quantity)).collect()
    }

    fn unmapped(&self, index: usize) -> Unmapped {
        let column = &self.columns[index];
        let dropped = self.dropped.iter().find(|(of, _)| *of == index);
        let candidate = self.candidates.iter().find(|it| it.column == index);
        let refused = self.refused.iter().find(|it| it.index == index);
        let reason = match (&column.unusable, dropped, candidate, refused) {
            (Some(reason), ..) => reason.clone(),
            (_, Some((_, reason)), ..) => reason.clone(),
            (_, _, Some(Candidate { guessed: it, .. }), _) => {
                let by = self.taken_for(it.quantity).map_or_else(String::new, |other| {
                    format!(", for which '{}' is taken", other.guessed.name.shown())
                });
                format!("could be {}{by}", it.quantity)
            }
            (.., Some(it)) => format!("not {}: {}", it.quantity, it.reason),
            _ if column.name.text.is_empty() => "it has no name".into(),
            _ => "its name says none of the quantities".into(),
        };
        Unmapped { name: column.name.clone(), reason }
    }
}
