//! Times as loggers write them: dates, and clock times that pass midnight.
//!
//! A run's times count from the midnight before its first row, so that they stay small numbers; the
//! day itself is kept beside them. Local time without a zone counts as UTC.

use time::format_description::{self, OwnedFormatItem};
use time::parsing::Parsed;
use time::{Date, Time};

const DAY_S: f64 = 86_400.0;
/// 1970-01-01 as a Julian day.
const UNIX_DAY: i64 = 2_440_588;

/// How a column's times are written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TimeFormat {
    /// `2026-03-18T07:13:20.2` of ISO 8601, or with a space in place of the T.
    Iso,
    /// `07:13:20.2`, which begins anew at midnight.
    Clock,
    /// As `strftime` writes it: `%d.%m.%Y %H:%M:%S`.
    Pattern(String),
}

/// The formats that are looked for in cells that nobody described, the likeliest first.
const PATTERNS: [&str; 9] = [
    "%d.%m.%Y %H:%M:%S",
    "%-d.%-m.%Y %-H:%M:%S",
    "%d/%m/%Y %H:%M:%S",
    "%m/%d/%Y %H:%M:%S",
    "%Y/%m/%d %H:%M:%S",
    "%d-%m-%Y %H:%M:%S",
    "%d.%m.%y %H:%M:%S",
    "%m/%d/%Y %I:%M:%S %p",
    "%Y%m%d %H:%M:%S",
];

impl TimeFormat {
    /// The format of this name, or of this pattern; `None` where it is none, or leaves hours or part
    /// of the date open.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "iso" => return Some(TimeFormat::Iso),
            "clock" => return Some(TimeFormat::Clock),
            _ => {}
        }
        let date = [DAY, MONTH, YEAR].map(|marks| has(name, marks));
        let is_whole = date.iter().all(|it| *it) || date.iter().all(|it| !*it);
        let is_sound = is_whole && has(name, HOUR) && compiled(name).is_some();
        is_sound.then(|| TimeFormat::Pattern(name.into()))
    }

    /// Its name or pattern.
    pub fn name(&self) -> &str {
        match self {
            TimeFormat::Iso => "iso",
            TimeFormat::Clock => "clock",
            TimeFormat::Pattern(pattern) => pattern,
        }
    }

    /// True where it holds the day, too.
    pub fn has_date(&self) -> bool {
        match self {
            TimeFormat::Iso => true,
            TimeFormat::Clock => false,
            TimeFormat::Pattern(pattern) => has(pattern, YEAR),
        }
    }

    /// What a cell should look like.
    pub fn example(&self) -> &str {
        match self {
            TimeFormat::Iso => "2026-03-18T07:13:20.2",
            TimeFormat::Clock => "07:13:20.2",
            TimeFormat::Pattern(pattern) => pattern,
        }
    }

    /// The formats in which a cell is a time, the likeliest first.
    pub(super) fn of_cell(cell: &[u8]) -> Vec<TimeFormat> {
        let patterns = PATTERNS.into_iter().map(|pattern| TimeFormat::Pattern(pattern.into()));
        let all = [TimeFormat::Iso, TimeFormat::Clock].into_iter().chain(patterns);
        // No number is a time, and most cells are numbers.
        let may_be = cell.contains(&b':');
        all.filter(|it| may_be && DayClock::new(it).seconds(cell).is_some()).collect()
    }
}

/// The marks of a pattern that stand for a part of a time.
const DAY: &[char] = &['d', 'e', 'F', 'D'];
const MONTH: &[char] = &['m', 'b', 'B', 'F', 'D'];
const YEAR: &[char] = &['Y', 'y', 'F', 'D'];
const HOUR: &[char] = &['H', 'I', 'k', 'l', 'T', 'R', 'r'];

fn has(pattern: &str, marks: &[char]) -> bool {
    pattern.split('%').skip(1).any(|part| part.trim_start_matches('-').starts_with(marks))
}

fn compiled(pattern: &str) -> Option<OwnedFormatItem> {
    format_description::parse_strftime_owned(pattern).ok()
}

/// Reads the times of a run, one row after the other.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct DayClock {
    format: TimeFormat,
    /// What stands before the fraction of the second; for [`TimeFormat::Iso`] date and clock time.
    items: Vec<OwnedFormatItem>,
    first_day: Option<i64>,
    last_s: Option<f64>,
}

impl DayClock {
    pub fn new(format: &TimeFormat) -> Self {
        let patterns: &[&str] = match format {
            TimeFormat::Iso => &["%Y-%m-%d", "%H:%M:%S"],
            TimeFormat::Clock => &["%-H:%M:%S"],
            TimeFormat::Pattern(pattern) => &[pattern],
        };
        let items = patterns.iter().filter_map(|pattern| compiled(pattern)).collect();
        DayClock { format: format.clone(), items, first_day: None, last_s: None }
    }

    /// The format that it reads.
    pub fn format(&self) -> &TimeFormat {
        &self.format
    }

    /// The day of the first row, counted from 1970-01-01; `None` where the times hold no date.
    pub fn first_day(&self) -> Option<i64> {
        self.first_day
    }

    /// A cell's time in s since the midnight before the first row; `None` for what is no such time.
    pub fn seconds(&mut self, cell: &[u8]) -> Option<f64> {
        let (day, of_day_s) = self.read(cell)?;
        let time_s = match day {
            Some(day) => {
                let day = day + (of_day_s / DAY_S).floor() as i64;
                let of_day_s = of_day_s.rem_euclid(DAY_S);
                let first = *self.first_day.get_or_insert(day);
                (day - first) as f64 * DAY_S + of_day_s
            }
            // The day in which it is nearest to the row before.
            None => {
                let last_s = self.last_s.unwrap_or(of_day_s);
                of_day_s + DAY_S * ((last_s - of_day_s) / DAY_S).round()
            }
        };
        self.last_s = Some(time_s);
        Some(time_s)
    }

    /// The day, where the cell holds it, and the second of it, in UTC.
    fn read(&self, cell: &[u8]) -> Option<(Option<i64>, f64)> {
        let mut parsed = Parsed::new();
        let mut rest = cell;
        for (index, item) in self.items.iter().enumerate() {
            if index > 0 {
                rest = rest.strip_prefix(b"T").or(rest.strip_prefix(b" "))?;
            }
            rest = parsed.parse_item(rest, item).ok()?;
        }
        let clock = Time::try_from(parsed).ok()?;
        let (fraction, rest) = fraction(rest)?;
        let zone_s = zone_s(rest)?;
        let of_day_s = f64::from(clock.hour()) * 3600.0
            + f64::from(clock.minute()) * 60.0
            + f64::from(clock.second())
            + fraction
            - zone_s;
        let has_date = parsed.day().is_some();
        let day = has_date.then(|| Date::try_from(with_century(parsed))).transpose().ok()?;
        Some((day.map(|it| i64::from(it.to_julian_day()) - UNIX_DAY), of_day_s))
    }
}

/// The day of a cell that holds a date and no time, counted from 1970-01-01.
pub(super) fn day_of_cell(cell: &[u8]) -> Option<i64> {
    ["%Y-%m-%d", "%d.%m.%Y", "%-d.%-m.%Y", "%d/%m/%Y"].iter().find_map(|pattern| {
        let mut parsed = Parsed::new();
        let rest = parsed.parse_item(cell, &compiled(pattern)?).ok()?;
        let day = Date::try_from(parsed).ok().filter(|_| rest.is_empty())?;
        Some(i64::from(day.to_julian_day()) - UNIX_DAY)
    })
}

/// Two digits of a year are those of this century.
fn with_century(mut parsed: Parsed) -> Parsed {
    if let (None, Some(last_two)) = (parsed.year(), parsed.year_last_two()) {
        parsed.set_year(2000 + i32::from(last_two));
    }
    parsed
}

/// A fraction of a second behind a point or a comma, 0 without, and what follows.
fn fraction(text: &[u8]) -> Option<(f64, &[u8])> {
    let Some(digits) = text.strip_prefix(b".").or(text.strip_prefix(b",")) else {
        return Some((0.0, text));
    };
    let count = digits.iter().take_while(|it| it.is_ascii_digit()).count();
    let (digits, rest) = digits.split_at(count);
    let value: f64 = std::str::from_utf8(digits).ok().filter(|it| it.len() <= 15)?.parse().ok()?;
    Some((value / 10_f64.powi(count as i32), rest))
}

/// A zone's offset in s: none, `Z`, or as `+01:00`.
fn zone_s(text: &[u8]) -> Option<f64> {
    let (sign, digits) = match text {
        b"" | b"Z" => return Some(0.0),
        [b'+', digits @ ..] => (1.0, digits),
        [b'-', digits @ ..] => (-1.0, digits),
        _ => return None,
    };
    let number = |digits: &[u8]| -> Option<f64> {
        let is_number = digits.len() == 2 && digits.iter().all(u8::is_ascii_digit);
        is_number.then(|| f64::from(digits[0] - b'0') * 10.0 + f64::from(digits[1] - b'0'))
    };
    let minutes = match digits.len() {
        2 => 0.0,
        4 => number(&digits[2..])?,
        5 if digits[2] == b':' => number(&digits[3..])?,
        _ => return None,
    };
    Some(sign * (number(&digits[..2])? * 3600.0 + minutes * 60.0))
}

/// The second since 1970 at which a TOML date or time begins; `None` for a mere time of day, or a day
/// that no calendar has.
pub(super) fn unix_s(at: &toml::value::Datetime) -> Option<i64> {
    let date = at.date?;
    let month = time::Month::try_from(date.month).ok()?;
    let day = Date::from_calendar_date(i32::from(date.year), month, date.day).ok()?;
    let second = at.time.map_or(0, |it| {
        i64::from(it.hour) * 3600 + i64::from(it.minute) * 60 + i64::from(it.second)
    });
    let zone_min = match at.offset {
        Some(toml::value::Offset::Custom { minutes }) => i64::from(minutes),
        _ => 0,
    };
    Some((i64::from(day.to_julian_day()) - UNIX_DAY) * 86_400 + second - 60 * zone_min)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(format: &str, cells: &[&str]) -> (Option<i64>, Vec<Option<f64>>) {
        let mut clock = DayClock::new(&TimeFormat::from_name(format).expect("a format"));
        let seconds = cells.iter().map(|cell| clock.seconds(cell.as_bytes())).collect();
        (clock.first_day(), seconds)
    }

    #[test]
    fn dates_count_from_the_midnight_before_the_first_row() {
        let cells = ["2026-03-18T07:13:20.25", "2026-03-18 07:13:21,5", "2026-03-19T00:00:01"];
        let (day, seconds) = read("iso", &cells);
        assert_eq!(day, Some(20_530));
        assert_eq!(seconds, [Some(26_000.25), Some(26_001.5), Some(86_401.0)]);
        let (day, seconds) = read("iso", &["2026-03-18T00:30:00+01:00", "2026-03-17T23:30:01Z"]);
        assert_eq!((day, seconds), (Some(20_529), vec![Some(84_600.0), Some(84_601.0)]));
        let (day, seconds) = read("%d.%m.%Y %H:%M:%S", &["18.03.2026 07:13:20,25"]);
        assert_eq!((day, seconds), (Some(20_530), vec![Some(26_000.25)]));
        let (day, seconds) = read("%m/%d/%Y %I:%M:%S %p", &["03/18/2026 07:13:20 PM"]);
        assert_eq!((day, seconds), (Some(20_530), vec![Some(69_200.0)]));
        assert_eq!(read("%d.%m.%y %H:%M:%S", &["18.03.26 07:13:20"]).0, Some(20_530));
    }

    #[test]
    fn clock_times_pass_midnight_and_rows_out_of_order_do_not() {
        let cells = ["23:59:59.5", "0:00:00,5", "23:59:59.9", "", "00:00:01"];
        let expected = [Some(86_399.5), Some(86_400.5), Some(86_399.9), None, Some(86_401.0)];
        assert_eq!(read("clock", &cells), (None, expected.to_vec()));
    }

    #[test]
    fn what_is_no_time_is_none() {
        for cell in
            ["", "x", "2026-03-18", "2026-02-30T00:00:00", "2026-03-18T25:00:00", "07:13:20"]
        {
            assert_eq!(read("iso", &[cell]).1, [None], "{cell}");
        }
        for cell in ["24:00:00", "07:60:00", "07:13:20.2x", "07:13:20.", "7", "07:13:20+1"] {
            assert_eq!(read("clock", &[cell]).1, [None], "{cell}");
        }
        for name in ["", "utc", "%H:%M:%Q", "%d.%m. %H:%M:%S", "%d.%m.%Y", "%"] {
            assert_eq!(TimeFormat::from_name(name), None, "{name}");
        }
    }

    #[test]
    fn a_format_is_recognised_by_its_cells() {
        let first = |cell: &str| {
            TimeFormat::of_cell(cell.as_bytes()).first().map(|it| it.name().to_owned())
        };
        let cases = [
            ("2026-03-18T07:13:20.2", Some("iso")),
            ("2026-03-18 07:13:20", Some("iso")),
            ("7:13:20", Some("clock")),
            ("18.03.2026 07:13:20,2", Some("%d.%m.%Y %H:%M:%S")),
            ("8.3.2026 7:13:20", Some("%-d.%-m.%Y %-H:%M:%S")),
            ("03/18/2026 07:13:20", Some("%m/%d/%Y %H:%M:%S")),
            ("3.5", None),
            ("12:5", None),
        ];
        for (cell, expected) in cases {
            assert_eq!(first(cell).as_deref(), expected, "{cell}");
        }
    }

    #[test]
    fn a_date_of_a_file_is_a_second_since_1970() {
        let at = |text: &str| unix_s(&text.parse().expect("a TOML date"));
        assert_eq!(at("2026-03-18"), Some(20_530 * 86_400));
        assert_eq!(at("2026-03-18T07:13:20"), Some(20_530 * 86_400 + 26_000));
        assert_eq!(at("2026-03-18T07:13:20+01:00"), Some(20_530 * 86_400 + 22_400));
        assert_eq!(at("07:13:20"), None);
    }
}
