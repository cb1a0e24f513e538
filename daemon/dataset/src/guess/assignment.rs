//! Which column is taken for which quantity, and which of the force columns, by their signs.

use std::cmp::Reverse;

use super::columns::{InspectedColumn, InspectedColumns};
use super::facts::Facts;
use super::guessed::{GivenColumn, GuessedColumn, Unmapped};
use super::matching::{UNKNOWN_UNIT, are_alike, can_hold, consider, figures};
use super::name::named_unit;
use crate::{DatasetError, Quantity, SourcePosition};

/// Logarithm of the ratio of a position's span and the integrated speed that gaps and wear explain.
const SPAN_MISFIT: f64 = 0.2;
/// A column whose name says less than another's by no more than this could be it as well.
const NEAR: i32 = 25;

/// A column that may hold a quantity.
#[derive(Clone)]
struct Candidate {
    /// Index of the column.
    column: usize,
    /// The greater the likelier.
    score: i32,
    /// Guessed column; the first reason is the word in the name that speaks for it.
    guessed: GuessedColumn,
}

/// Assignment of columns to quantities.
pub struct Assignment<'c> {
    columns: &'c [InspectedColumn],
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
        for it in given {
            let place = || SourcePosition::line(label, columns.layout.text.skip_rows + 1);
            assignment.take_given(it, columns).map_err(|words| place().problem(words))?;
        }
        for (index, column) in columns.columns.iter().enumerate() {
            if assignment.is_taken(index) {
                continue;
            }
            let is_given = |quantity: &Quantity| given.iter().any(|it| it.quantity == *quantity);
            for quantity in Quantity::ALL.into_iter().filter(|it| !is_given(it)) {
                match (consider(&column.name, &column.all, quantity), &column.unusable) {
                    (None, _) => {}
                    (Some(_), Some(reason)) => {
                        assignment.refused.push((index, quantity, reason.clone()));
                    }
                    (Some(found), None) => match found {
                        Ok((score, guessed)) => {
                            assignment.candidates.push(Candidate { column: index, score, guessed });
                        }
                        Err(reason) => assignment.refused.push((index, quantity, reason)),
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
        self.taken.push((index, guessed.given_as(given.format.as_ref()), true));
        Ok(())
    }

    /// The best candidate first, then the best of those that are left.
    fn take_best(&mut self) {
        let mut candidates = self.candidates.clone();
        candidates.sort_by_key(|it| (Reverse(it.score), it.guessed.quantity, it.column));
        for Candidate { column, guessed, .. } in candidates {
            if !self.is_taken(column) && !self.has(guessed.quantity) {
                self.taken.push((column, guessed, false));
            }
        }
    }

    /// Takes columns for parts that add up where they are alike but for what numbers them, and doubts what another
    /// column could be as well.
    fn weigh_others(&mut self) {
        for place in 0..self.taken.len() {
            let (index, guessed, is_given_here) = &self.taken[place];
            if *is_given_here {
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
            let guessed = &mut self.taken[place].1;
            guessed.parts = parts;
            guessed.doubts.extend(doubts);
        }
    }

    fn score(&self, index: usize, quantity: Quantity) -> i32 {
        let is_it = |it: &&Candidate| it.column == index && it.guessed.quantity == quantity;
        self.candidates.iter().find(is_it).map_or(0, |it| it.score)
    }

    /// The first column that would be a quantity that nothing is taken for, were its unit known.
    pub fn unknown_unit(&self) -> Option<(&'c InspectedColumn, Quantity, &str)> {
        self.refused.iter().find_map(|(index, quantity, reason)| {
            let is_it = reason.starts_with(UNKNOWN_UNIT)
                && !self.has(*quantity)
                && !self.is_taken(*index)
                && self.columns[*index].all.formats().is_empty();
            is_it.then(|| (&self.columns[*index], *quantity, reason.as_str()))
        })
    }

    fn is_part(&self, index: usize) -> bool {
        let name = &self.columns[index].name;
        self.taken.iter().any(|(_, guessed, _)| guessed.parts.contains(name))
    }

    fn is_taken(&self, index: usize) -> bool {
        self.taken.iter().any(|(other, ..)| *other == index)
    }

    fn taken_for(&self, quantity: Quantity) -> Option<&(usize, GuessedColumn, bool)> {
        self.taken.iter().find(|(_, guessed, _)| guessed.quantity == quantity)
    }

    /// True where a column is taken for the quantity.
    pub fn has(&self, quantity: Quantity) -> bool {
        self.taken_for(quantity).is_some()
    }

    /// Returns the facts on the values of the column assigned to a quantity.
    pub fn facts(&self, quantity: Quantity) -> Option<&'c Facts> {
        self.taken_for(quantity).map(|(index, ..)| &self.columns[*index].all)
    }

    /// Takes the column for the position that spans what the speed says, where another does not and more speaks for
    /// its name.
    pub fn weigh_positions(&mut self) {
        let Some((at, taken, false)) = self
            .taken_for(Quantity::Position)
            .map(|(at, guessed, given)| (*at, guessed.clone(), *given))
        else {
            return;
        };
        let Some((time_at, time, _)) = self.taken_for(Quantity::Time) else { return };
        let Some((speed_at, speed, _)) = self.taken_for(Quantity::Speed) else { return };
        let facts = |column: usize| &self.columns[column].facts;
        let base =
            |guessed: &GuessedColumn, value: f64| guessed.unit.to_base(value * guessed.scale);
        // Times that are no numbers are in s already.
        let driven_m: f64 = facts(*time_at)
            .iter()
            .zip(facts(*speed_at))
            .filter_map(|(times, speeds)| {
                Some(base(time, times.span()?) * base(speed, speeds.mean()?))
            })
            .sum();
        let misfit = |column: usize, guessed: &GuessedColumn| {
            let spans = facts(column).iter().filter_map(Facts::span);
            (spans.map(|span| base(guessed, span)).sum::<f64>() / driven_m).ln().abs()
        };
        let own = misfit(at, &taken);
        let others = self
            .candidates
            .iter()
            .filter(|it| it.guessed.quantity == Quantity::Position && !self.is_taken(it.column));
        let best = others
            .map(|it| (misfit(it.column, &it.guessed), it))
            .filter(|(misfit, _)| *misfit < SPAN_MISFIT && own > 2.0 * SPAN_MISFIT)
            .min_by(|one, other| one.0.total_cmp(&other.0));
        let Some((_, best)) = best else { return };
        let (column, mut guessed) = (best.column, best.guessed.clone());
        guessed
            .reasons
            .push(format!("it spans what the speed says, which '{}' does not", self.shown(at)));
        self.taken.retain(|(_, guessed, _)| guessed.quantity != Quantity::Position);
        self.taken.push((column, guessed, false));
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

    /// Returns the columns that come near a quantity without an assigned column, each with the reason.
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
        let left =
            (0..self.columns.len()).filter(|index| !self.is_taken(*index) && !self.is_part(*index));
        let unmapped = left.map(|index| self.unmapped(index)).collect();
        let mut columns: Vec<_> = self.taken.into_iter().map(|(_, guessed, _)| guessed).collect();
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
        let refused = self.refused.iter().filter(|(of, ..)| *of == index);
        let refused = refused.map(|(_, quantity, reason)| format!("not {quantity}: {reason}"));
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
        let refused = self.refused.iter().find(|(of, ..)| *of == index);
        let reason = match (&column.unusable, dropped, candidate, refused) {
            (Some(reason), ..) => reason.clone(),
            (_, Some((_, reason)), ..) => reason.clone(),
            (_, _, Some(Candidate { guessed: it, .. }), _) => {
                let by = self.taken_for(it.quantity).map_or_else(String::new, |(_, other, _)| {
                    format!(", for which '{}' is taken", other.name.shown())
                });
                format!("could be {}{by}", it.quantity)
            }
            (.., Some((_, quantity, reason))) => format!("not {quantity}: {reason}"),
            _ if column.name.text.is_empty() => "it has no name".into(),
            _ => "its name says none of the quantities".into(),
        };
        Unmapped { name: column.name.clone(), reason }
    }
}

/// A force with more than this share of values below zero is signed.
const SIGNED_SHARE: f64 = 0.02;

/// Settles what a dataset cannot have at once: a signed force beside one that is never negative, a
/// handle beside a force.
pub fn settle(assignment: &mut Assignment) {
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
        let scale = crate::keys::column::SCALE.assign(-1);
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
