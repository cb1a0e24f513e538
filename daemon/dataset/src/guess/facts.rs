//! Facts on the values of a column, and times packed into one number.

use crate::TimeFormat;
use crate::cell::{parse_cell, truth};
use crate::clock::{DayClock, PACKED_CLOCK, day_of_cell};
use crate::fill_values::is_usual;
use crate::text_layout::Marks;

/// Number of values of a column that are kept, evenly spread, to find its middle and its top.
const KEPT_MAX: usize = 4096;

/// Values spread evenly over all that came.
#[derive(Clone, Debug, Default, PartialEq)]
struct Spread {
    values: Vec<f64>,
    halved: u32,
    seen: usize,
}

impl Spread {
    pub fn push(&mut self, value: f64) {
        if self.seen.is_multiple_of(1 << self.halved) {
            self.values.push(value);
        }
        self.seen += 1;
        if self.values.len() > KEPT_MAX {
            self.values = self.values.iter().step_by(2).copied().collect();
            self.halved += 1;
        }
    }

    /// Returns the mean; `None` without a value.
    fn mean(&self) -> Option<f64> {
        let count = self.values.len();
        (count > 0).then(|| self.values.iter().sum::<f64>() / count as f64)
    }

    /// Returns the value below which this share of the values' magnitudes lies.
    fn quantile(&self, share: f64, of: impl Fn(f64) -> f64) -> Option<f64> {
        let mut sorted: Vec<f64> = self.values.iter().map(|&value| of(value)).collect();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        sorted.get((share * last as f64).round() as usize).copied()
    }
}

/// A cell that holds text where numbers were expected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextCell {
    /// The file and a comma, where there are several.
    pub file: String,
    /// Line in the file, from 1.
    pub line: usize,
    /// The cell, on one line.
    pub cell: String,
}

impl TextCell {
    /// Returns the same, with its file where there are several.
    pub fn of_file(self, label: &str, files: usize) -> Self {
        let file = if files > 1 { format!("{label}, ") } else { String::new() };
        TextCell { file, ..self }
    }
}

/// Facts on a column's values, collected cell by cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// Cells with a finite number.
    pub numbers: usize,
    /// The first cell that is neither empty nor a number.
    pub text: Option<TextCell>,
    /// Cells that are neither.
    pub texts: usize,
    /// Cells that say yes or no.
    pub truths: usize,
    /// The least number.
    pub min: f64,
    /// The greatest number.
    pub max: f64,
    /// The first cell that is a date and nothing else, counted in days from 1970-01-01.
    pub day: Option<i64>,
    /// Readers of the formats in which the cells so far are times, the likeliest first.
    clocks: Vec<DayClock>,
    packed: Option<Packed>,
    last: f64,
    growing: usize,
    falling: usize,
    pairs: usize,
    values: Spread,
    steps: Spread,
}

/// Times that show a column of times.
const TIMES_MIN: usize = 20;
/// Steps that show that the newest row stands first.
const FALLING_MIN: usize = 20;

impl Facts {
    /// Returns the facts before any cell is seen.
    pub fn new() -> Self {
        let (min, max) = (f64::INFINITY, f64::NEG_INFINITY);
        Facts { min, max, last: f64::NAN, packed: Some(Packed::NEW), ..Facts::default() }
    }

    /// Takes in a trimmed cell of a line: a number, a time, or text.
    pub fn push_cell(&mut self, line: usize, cell: &[u8], marks: Marks) {
        match parse_cell(cell, marks) {
            Some(value) if value.is_nan() || self.clocks.is_empty() => self.push(value),
            None if truth(cell).is_some() => {
                self.truths += 1;
                self.push(truth(cell).unwrap_or(f64::NAN));
            }
            None if self.may_hold_times() => match self.time_s(cell) {
                Some(time_s) => self.push(time_s),
                None => self.push_text(line, &String::from_utf8_lossy(cell)),
            },
            _ => self.push_text(line, &String::from_utf8_lossy(cell)),
        }
    }

    /// Returns whether every cell so far was empty or a time, but for words among many times.
    fn may_hold_times(&self) -> bool {
        !self.clocks.is_empty() || (self.text.is_none() && self.numbers == 0)
    }

    /// Returns a cell's time in the likeliest format that holds for all cells so far.
    fn time_s(&mut self, cell: &[u8]) -> Option<f64> {
        if self.clocks.is_empty() {
            self.day = self.day.or_else(|| day_of_cell(cell));
            self.clocks = TimeFormat::of_cell(cell).iter().map(DayClock::new).collect();
        }
        let times_s: Vec<Option<f64>> =
            self.clocks.iter_mut().map(|clock| clock.seconds(cell)).collect();
        let first_s = times_s.iter().flatten().next().copied();
        // A word among times, as in a row of totals, says nothing of their format.
        if first_s.is_some() || self.numbers < TIMES_MIN {
            let mut times_s = times_s.iter();
            self.clocks.retain(|_| times_s.next().is_some_and(Option::is_some));
        }
        first_s
    }

    /// Returns the formats in which the values are times, the likeliest first; none for numbers.
    pub fn formats(&self) -> Vec<&TimeFormat> {
        self.clocks.iter().map(DayClock::format).collect()
    }

    /// Adds a cell's number; a value that is not finite counts as missing.
    pub fn push(&mut self, value: f64) {
        if !value.is_finite() {
            return;
        }
        if self.numbers > 0 {
            let step = value - self.last;
            self.growing += usize::from(step > 0.0);
            self.falling += usize::from(step < 0.0);
            self.pairs += 1;
            self.steps.push(step.abs());
        }
        if let Some(packed) = &mut self.packed {
            packed.push(value);
        }
        self.last = value;
        self.numbers += 1;
        self.min = self.min.min(value);
        self.max = self.max.max(value);
        self.values.push(value);
    }

    /// Takes in a cell that is no number.
    fn push_text(&mut self, line: usize, cell: &str) {
        let printable = |letter: char| if letter.is_control() { ' ' } else { letter };
        let cell = || cell.chars().take(40).map(printable).collect();
        self.texts += 1;
        self.text.get_or_insert_with(|| TextCell { file: String::new(), line, cell: cell() });
    }

    /// Adds the facts on the same column in another file.
    pub fn merge(&mut self, other: &Facts) {
        match self.numbers {
            0 => self.clocks.clone_from(&other.clocks),
            _ if other.numbers > 0 => {
                self.clocks.retain(|clock| other.formats().contains(&clock.format()));
            }
            _ => {}
        }
        let own = self.packed.and_then(|it| it.pattern());
        self.packed = other.packed.filter(|it| self.numbers == 0 || own == it.pattern());
        self.numbers += other.numbers;
        self.texts += other.texts;
        self.truths += other.truths;
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.growing += other.growing;
        self.falling += other.falling;
        self.pairs += other.pairs;
        other.values.values.iter().for_each(|&value| self.values.push(value));
        other.steps.values.iter().for_each(|&step| self.steps.push(step));
    }

    /// Returns the greatest magnitude, single spikes left out; `None` without a number.
    pub fn top(&self) -> Option<f64> {
        let top = self.values.quantile(0.99, f64::abs)?;
        let is_fill = |value: f64| value.abs() == top && is_usual(value);
        if !is_usual(top) || self.values.values.iter().all(|value| is_fill(*value)) {
            return Some(top);
        }
        let others = self.values.values.iter().copied().filter(|value| !is_fill(*value));
        Spread { values: others.collect(), ..Spread::default() }.quantile(0.99, f64::abs)
    }

    /// Returns the mean; `None` without a number.
    pub fn mean(&self) -> Option<f64> {
        self.values.mean()
    }

    /// Returns the middle value; `None` without a number.
    pub fn middle(&self) -> Option<f64> {
        self.values.quantile(0.5, |value| value)
    }

    /// Returns the middle of the steps between rows; `None` with less than two numbers.
    pub fn step(&self) -> Option<f64> {
        self.steps.quantile(0.5, |step| step)
    }

    /// From the least to the greatest number.
    pub fn span(&self) -> Option<f64> {
        (self.numbers > 0).then_some(self.max - self.min)
    }

    /// Returns whether nearly every number is greater than the one before, or as great.
    pub fn grows(&self) -> bool {
        let changing = self.growing + self.falling;
        // Several rows may share a whole second; rows in disorder fall as often as they grow.
        self.growing > 0 && self.growing * 10 >= changing * 3 && self.growing * 50 >= self.pairs
    }

    /// Returns whether nearly every number is less than the one before: of times, the newest stands first.
    pub fn falls(&self) -> bool {
        self.falling * 50 >= self.pairs * 49 && self.falling >= FALLING_MIN
    }

    /// Returns the format in which the numbers are packed times.
    pub fn packed(&self) -> Option<TimeFormat> {
        self.packed?.pattern().map(|it| TimeFormat::Pattern(it.into()))
    }

    /// -1 where the number falls in most steps, else 1.
    pub fn direction(&self) -> i8 {
        if self.falling > self.growing { -1 } else { 1 }
    }

    /// Returns the shares of the values that are above and below zero by more than noise.
    pub fn signs(&self) -> (f64, f64) {
        let least = 0.02 * self.top().unwrap_or(0.0);
        let share = |sign: f64| {
            let count = self.values.values.iter().filter(|&&value| sign * value > least).count();
            count as f64 / self.values.values.len().max(1) as f64
        };
        (share(1.0), share(-1.0))
    }
}

const PACKED_DATE: &str = "%Y%m%d%H%M%S";
const PACKED_SHORT_DATE: &str = "%y%m%d%H%M%S";

/// Whether numbers are times that are packed: hours, minutes and seconds as digits, with or without a date before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Packed {
    is_clock: bool,
    is_date: bool,
    is_short_date: bool,
    last: f64,
    /// Number of times that the seconds began anew.
    minutes: usize,
}

impl Packed {
    /// Nothing seen yet.
    pub const NEW: Packed =
        Packed { is_clock: true, is_date: true, is_short_date: true, last: f64::NAN, minutes: 0 };

    /// Takes in a number.
    pub fn push(&mut self, number: f64) {
        // Thousandths may follow as digits.
        let number = if number >= 1e16 { (number / 1e3).floor() } else { number };
        let clock = number.rem_euclid(1e6);
        let part = |below: f64, over: f64| (clock / over).floor().rem_euclid(100.0) < below;
        let is_clock = part(24.0, 1e4) && part(60.0, 100.0) && part(60.0, 1.0);
        self.is_clock &= is_clock && (0.0..240_000.0).contains(&number);
        self.is_date &= is_clock && (19_700_101e6..21_000_101e6).contains(&number);
        self.is_short_date &= is_clock && (10_101e6..1e12).contains(&number);
        // From 59 to 0 a packed time leaps by 40 at least, and a count of seconds does not.
        self.minutes += usize::from(number - self.last >= 40.0 && number % 100.0 < 30.0);
        self.last = number;
    }

    /// Returns the pattern; `None` for numbers that are none, or that do not show it.
    pub fn pattern(&self) -> Option<&'static str> {
        match self {
            Packed { is_date: true, last, .. } if !last.is_nan() => Some(PACKED_DATE),
            Packed { is_short_date: true, minutes: 2.., .. } => Some(PACKED_SHORT_DATE),
            Packed { is_clock: true, minutes: 2.., .. } => Some(PACKED_CLOCK),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facts(values: impl IntoIterator<Item = f64>) -> Facts {
        let mut facts = Facts::new();
        values.into_iter().for_each(|value| facts.push(value));
        facts
    }

    #[test]
    fn middle_top_and_step_are_reported_of_columns_of_any_length() {
        for count in [3_usize, 100, 50_000] {
            let seen = facts((0..count).map(|row| row as f64 * 0.5));
            let end = (count - 1) as f64 * 0.5;
            assert_eq!(seen.span(), Some(end));
            assert_eq!(seen.step(), Some(0.5));
            let middle = seen.middle().unwrap();
            assert!((middle - end / 2.0).abs() < 0.01 * end + 0.5, "{count}: {middle}");
            assert!(seen.top().unwrap() >= 0.97 * end && seen.grows(), "{count}");
            assert!(seen.values.values.len() <= KEPT_MAX);
        }
    }

    #[test]
    fn one_spike_makes_no_top() {
        let seen = facts((0..1000).map(|row| if row == 500 { 1e6 } else { 30.0 }));
        assert_eq!((seen.top(), seen.max), (Some(30.0), 1e6));
    }

    #[test]
    fn directions_and_signs_are_reported() {
        assert_eq!(facts([5.0, 4.0, 3.0]).direction(), -1);
        assert_eq!(facts([5.0, 4.0, 6.0]).direction(), 1);
        assert!(!facts([3.0, 2.0, 1.0]).grows() && !facts([1.0, 1.0]).grows());
        let (up, down) = facts([100.0, 100.0, -100.0, 0.5]).signs();
        assert_eq!((up, down), (0.5, 0.25));
    }

    #[test]
    fn without_numbers_nothing_is_reported() {
        let mut seen = facts([f64::NAN, f64::INFINITY]);
        seen.push_text(3, "a\tb");
        seen.push_text(4, "c");
        assert_eq!((seen.top(), seen.middle(), seen.step(), seen.span()), (None, None, None, None));
        assert_eq!(seen.text, Some(TextCell { file: String::new(), line: 3, cell: "a b".into() }));
    }
}
