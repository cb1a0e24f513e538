//! Scores of a pipeline's answers, its usable estimates of a quantity, over a drive.

use dynocar_shared::{HALF_95, Uncertain};

use crate::statistics::median;

/// Speed in m/s from which an answer counts.
pub const COUNTS_MPS: f64 = 2.0;
/// Number of standard deviations beyond which an answer is wrong.
const WRONG: f64 = 4.0;
/// Share of the truth by which the error of an answer must exceed that of the declared value before the answer counts
/// as worse.
const WORSE_BY: f64 = 0.01;

/// A usable answer: its error, its standard deviation, and the error of the declared value, each over the truth.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    /// Error over the truth.
    pub error: f64,
    deviation: f64,
    declared_error: f64,
}

impl Answer {
    /// Compares an estimate with the declared value and the truth.
    pub fn of(found: Uncertain, declared: f64, truth: f64) -> Self {
        let error = |value: f64| (value - truth) / truth;
        let deviation = found.std / truth;
        Answer { error: error(found.value), deviation, declared_error: error(declared) }
    }
}

/// Time in s from which an answer is expected.
const SETTLED_S: f64 = 120.0;
/// Deviation of the mass as a share of it from which it is known.
const KNOWN: f64 = 0.025;

/// One quantity of one pipeline over one drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuantityScore {
    /// Cycles of the moving train.
    pub cycles: u64,
    /// Those in which the answer was called usable.
    pub usable: u64,
    /// Of those, the truth within the 95 % interval.
    pub covered: u64,
    /// Of those, the truth more than four deviations off.
    pub wrong: u64,
    /// Of those, the declared value nearer to the truth, by 1 % of the truth.
    pub worse: u64,
    /// Changes of usable.
    pub changes: u64,
    /// Time in s until the first usable answer.
    pub first_s: Option<f64>,
    /// Longest time in s that a usable answer was wrong.
    pub wrong_s: f64,
    wrong_now_s: f64,
    /// Sum of squares of the usable answers' errors, relative to the truth.
    pub error_square: f64,
    /// The same of their deviations.
    pub deviation_square: f64,
    /// The same of the declared values at these moments.
    pub declared_square: f64,
    /// Sum of squares of errors where they are compared with the least deviations.
    pub compared_square: f64,
    /// The same of the least deviations there.
    pub least_square: f64,
    was_usable: bool,
    /// Cycles after the first two minutes, and those with a usable answer.
    pub later: [u64; 2],
    /// Motion in s after each stop until the answer was known again, and of the newest so far.
    known_s: Vec<f64>,
    moving_s: Option<f64>,
    was_known: bool,
}

impl QuantityScore {
    /// Scores a cycle of `cycle_s` seconds.
    pub fn push(&mut self, time_s: f64, cycle_s: f64, answer: Option<Answer>) {
        self.cycles += 1;
        if time_s >= SETTLED_S {
            self.later[0] += 1;
            self.later[1] += u64::from(answer.is_some());
        }
        self.changes += u64::from(answer.is_some() != self.was_usable);
        self.was_usable = answer.is_some();
        let Some(Answer { error, deviation, declared_error }) = answer else {
            self.wrong_now_s = 0.0;
            return;
        };
        let is_wrong = error.abs() > WRONG * deviation;
        self.usable += 1;
        self.first_s.get_or_insert(time_s);
        self.covered += u64::from(error.abs() <= HALF_95 * deviation);
        self.wrong += u64::from(is_wrong);
        self.worse += u64::from(error.abs() - declared_error.abs() > WORSE_BY);
        self.error_square += error * error;
        self.deviation_square += deviation * deviation;
        self.declared_square += declared_error * declared_error;
        self.wrong_now_s = if is_wrong { self.wrong_now_s + cycle_s } else { 0.0 };
        self.wrong_s = self.wrong_s.max(self.wrong_now_s);
    }

    /// Takes in whether the train stands: how long it moves after a stop until an answer that was known once is known
    /// again.
    pub fn follow_stops(&mut self, is_standing: bool, cycle_s: f64, answer: Option<Answer>) {
        let is_known = answer.is_some_and(|it| it.deviation < KNOWN);
        self.was_known |= is_known;
        if is_standing {
            let before_s = std::mem::replace(&mut self.moving_s, self.was_known.then_some(0.0));
            self.known_s.extend(before_s.filter(|moving_s| *moving_s > 0.0));
        } else if let Some(moving_s) = &mut self.moving_s {
            *moving_s += cycle_s;
            if is_known {
                self.known_s.push(*moving_s);
                self.moving_s = None;
            }
        }
    }

    /// Takes in a usable answer's error and the least deviation, both relative to the truth.
    pub fn compare(&mut self, error: f64, least: f64) {
        self.compared_square += error * error;
        self.least_square += least * least;
    }
}

/// A quantity over several drives.
pub struct Scores<'a>(pub &'a [QuantityScore]);

impl Scores<'_> {
    /// Returns the sum of a count over all drives.
    pub fn count(&self, of: fn(&QuantityScore) -> u64) -> u64 {
        self.0.iter().map(of).sum()
    }

    /// Returns a count as a share of the cycles with a usable answer, in %.
    pub fn percent(&self, of: fn(&QuantityScore) -> u64) -> f64 {
        100.0 * self.count(of) as f64 / self.count(|it| it.usable).max(1) as f64
    }

    /// Returns the root of a mean square over the usable answers, in % of the truth; no number where none was usable.
    pub fn rms_percent(&self, of: fn(&QuantityScore) -> f64) -> f64 {
        100.0 * (self.sum(of) / self.count(|it| it.usable) as f64).sqrt()
    }

    /// Returns the root of one sum over another; NaN where the other is zero.
    pub fn ratio(&self, of: fn(&QuantityScore) -> f64, over: fn(&QuantityScore) -> f64) -> f64 {
        (self.sum(of) / self.sum(over)).sqrt()
    }

    fn sum(&self, of: fn(&QuantityScore) -> f64) -> f64 {
        self.0.iter().map(of).sum()
    }

    /// Returns the share of the time in which the answer was usable, in %.
    pub fn usable_percent(&self) -> f64 {
        let share = self.count(|it| it.usable) as f64 / self.count(|it| it.cycles).max(1) as f64;
        100.0 * share
    }

    /// Returns the same after the first two minutes.
    pub fn usable_later_percent(&self) -> f64 {
        let (cycles, usable) = (self.count(|it| it.later[0]), self.count(|it| it.later[1]));
        100.0 * usable as f64 / cycles.max(1) as f64
    }

    /// Returns the time of motion in s after a stop until the answer was known again, for 19 stops of 20.
    pub fn known_again_s(&self) -> Option<f64> {
        let mut all: Vec<f64> = self.0.iter().flat_map(|it| it.known_s.iter().copied()).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() * 19 / 20).copied()
    }

    /// Returns the median time in s until the first use.
    pub fn first_use_s(&self) -> Option<f64> {
        median(self.0.iter().map(|it| it.first_s.unwrap_or(f64::INFINITY)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_counts_until_an_answer_is_known_again_but_not_until_it_is_known_first() {
        let mut score = QuantityScore::default();
        for cycle in 0..60 {
            // Stops of 5 s, each followed by 15 s of motion, and known 8 s after the first start, 3 s after others.
            let (second, stop) = (cycle % 20, cycle / 20);
            let is_known = second >= if stop == 0 { 13 } else { 8 };
            let std = if is_known { 0.01 } else { 0.1 };
            let answer = Answer::of(Uncertain::new(1.0, std), 1.0, 1.0);
            score.follow_stops(second < 5, 1.0, Some(answer));
        }
        assert_eq!(score.known_s, [4.0, 4.0]);
    }
}
