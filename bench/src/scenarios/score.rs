//! What answers were worth over a drive.

use dynocar_shared::{HALF_95, Uncertain};

use crate::output::Record;
use crate::statistics::median;

/// Speed in m/s from which an answer counts.
pub const COUNTS_MPS: f64 = 2.0;
/// Deviations beyond which an answer is wrong.
const WRONG: f64 = 4.0;
/// Share of the truth by which a worse answer than the declared one is worse.
const WORSE_BY: f64 = 0.01;

/// A usable answer: its error, its standard deviation, and the error of what is declared, over the truth.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    /// Error over the truth.
    pub error: f64,
    deviation: f64,
    declared_error: f64,
}

impl Answer {
    /// What was found, beside what is declared and the truth.
    pub fn of(found: Uncertain, declared: f64, truth: f64) -> Self {
        let error = |value: f64| (value - truth) / truth;
        let deviation = found.std / truth;
        Answer { error: error(found.value), deviation, declared_error: error(declared) }
    }
}

/// One quantity of one pipeline over one drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Score {
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
    /// The same of what is declared then.
    pub declared_square: f64,
    /// Sum of squares of errors where they are compared with the least deviations.
    pub compared_square: f64,
    /// The same of the least deviations there.
    pub least_square: f64,
    was_usable: bool,
}

impl Score {
    /// Takes in a cycle of so many s.
    pub fn push(&mut self, time_s: f64, cycle_s: f64, answer: Option<Answer>) {
        self.cycles += 1;
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

    /// Takes in a usable answer's error and the least deviation, both relative to the truth.
    pub fn compare(&mut self, error: f64, least: f64) {
        self.compared_square += error * error;
        self.least_square += least * least;
    }
}

/// A quantity over several drives.
pub struct Scores<'a>(pub &'a [Score]);

impl Scores<'_> {
    /// The sum of a count over all drives.
    pub fn count(&self, of: fn(&Score) -> u64) -> u64 {
        self.0.iter().map(of).sum()
    }

    /// A count as a share of the cycles with a usable answer, in %.
    pub fn percent(&self, of: fn(&Score) -> u64) -> f64 {
        100.0 * self.count(of) as f64 / self.count(|it| it.usable).max(1) as f64
    }

    /// Root of a mean square over the usable answers, in % of the truth; no number where none was usable.
    pub fn rms_percent(&self, of: fn(&Score) -> f64) -> f64 {
        100.0 * (self.sum(of) / self.count(|it| it.usable) as f64).sqrt()
    }

    /// The root of one sum over another; no number where the other is none.
    pub fn ratio(&self, of: fn(&Score) -> f64, over: fn(&Score) -> f64) -> f64 {
        (self.sum(of) / self.sum(over)).sqrt()
    }

    fn sum(&self, of: fn(&Score) -> f64) -> f64 {
        self.0.iter().map(of).sum()
    }

    /// With the share of the time in which the answer was usable.
    pub fn usable(&self, record: Record) -> Record {
        let share = self.count(|it| it.usable) as f64 / self.count(|it| it.cycles).max(1) as f64;
        record.number("usable_percent", 100.0 * share, 1)
    }

    /// With the median time until the first use.
    pub fn first_use(&self, record: Record) -> Record {
        let first_s = self.0.iter().map(|it| it.first_s.unwrap_or(f64::INFINITY));
        record.number("first_use_s", median(first_s.collect()), 0)
    }
}
