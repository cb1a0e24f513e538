//! Times packed into one number.

/// Hours, minutes and seconds as digits.
pub const PACKED_CLOCK: &str = "%H%M%S";
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
