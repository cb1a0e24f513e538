//! Times as loggers write them: dates, and clock times that pass midnight.
//!
//! A run's times count from the midnight before its first row, so that they stay small numbers; the day is kept apart.
//! Local time without a zone counts as UTC.

use std::borrow::Cow;

use time::format_description::{self, OwnedFormatItem};
use time::parsing::Parsed;
use time::{Date, Time};

/// Hours, minutes and seconds as digits.
pub(super) const PACKED_CLOCK: &str = "%H%M%S";
const DAY_S: f64 = 86_400.0;
/// 1970-01-01 as a Julian day.
const UNIX_DAY: i64 = 2_440_588;

/// Format of a column's times.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TimeFormat {
    /// `2026-03-18T07:13:20.2` of ISO 8601, or with a space in place of the T.
    Iso,
    /// `07:13:20.2`, which begins again at midnight.
    Clock,
    /// `0 days 07:13:20.2`, or `31:13:20.2`: the time since a start.
    Elapsed,
    /// As `strftime` writes it: `%d.%m.%Y %H:%M:%S`.
    Pattern(String),
}

/// Formats that are tried on cells that nobody described, the likeliest first.
const PATTERNS: [&str; 28] = [
    "%d.%m.%Y %H:%M:%S",
    "%-d.%-m.%Y %-H:%M:%S",
    "%d/%m/%Y %H:%M:%S",
    "%m/%d/%Y %H:%M:%S",
    "%Y/%m/%d %H:%M:%S",
    "%d-%m-%Y %H:%M:%S",
    "%d.%m.%y %H:%M:%S",
    "%m/%d/%Y %I:%M:%S %p",
    "%-m/%-d/%Y %-I:%M:%S %p",
    "%-m/%-d/%Y %-H:%M:%S",
    "%-I:%M:%S %p",
    "%Y%m%d %H:%M:%S",
    "%Y%m%dT%H%M%S",
    "%d-%b-%Y %H:%M:%S",
    "%d %b %Y %H:%M:%S",
    "%b %d, %Y %-I:%M:%S %p",
    "%b %d %Y %H:%M:%S",
    "%b %d, %Y %H:%M:%S",
    "%B %d, %Y %H:%M:%S",
    "%d %B %Y %H:%M:%S",
    "%d-%b-%y %H:%M:%S",
    "%a %b %d %H:%M:%S %Y",
    "%a, %d %b %Y %H:%M:%S",
    "%Y年%m月%d日 %H:%M:%S",
    "%Y-%m-%d_%H-%M-%S",
    "%Y%m%d_%H%M%S",
    DOTTED_CLOCK,
    "%-M:%S",
];
/// A clock's time that is a date, too, unless a comma stands before its fraction.
const DOTTED_CLOCK: &str = "%H.%M.%S";
impl TimeFormat {
    /// Returns the format of this name, or of this pattern; `None` if it is not a format, or leaves hours or part
    /// of the date open.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "iso" => return Some(TimeFormat::Iso),
            "clock" => return Some(TimeFormat::Clock),
            "elapsed" => return Some(TimeFormat::Elapsed),
            _ => {}
        }
        let date = [DAY, MONTH, YEAR].map(|marks| has(name, marks));
        let is_whole = date.iter().all(|it| *it) || date.iter().all(|it| !*it);
        let has_clock = has(name, HOUR) || (!date[0] && has(name, MINUTE) && has(name, SECOND));
        let is_sound = is_whole && has_clock && compiled(without_half(name)).is_some();
        is_sound.then(|| TimeFormat::Pattern(name.into()))
    }

    /// Returns its name or pattern.
    pub fn name(&self) -> &str {
        match self {
            TimeFormat::Iso => "iso",
            TimeFormat::Clock => "clock",
            TimeFormat::Elapsed => "elapsed",
            TimeFormat::Pattern(pattern) => pattern,
        }
    }

    /// Returns whether it holds the day, too.
    pub fn has_date(&self) -> bool {
        match self {
            TimeFormat::Iso => true,
            TimeFormat::Clock | TimeFormat::Elapsed => false,
            TimeFormat::Pattern(pattern) => has(pattern, YEAR),
        }
    }

    /// Returns an example of a cell.
    pub fn example(&self) -> &str {
        match self {
            TimeFormat::Iso => "2026-03-18T07:13:20.2",
            TimeFormat::Clock => "07:13:20.2",
            TimeFormat::Elapsed => "0 days 07:13:20.2",
            TimeFormat::Pattern(pattern) => pattern,
        }
    }

    /// Returns the formats in which a cell is a time, the likeliest first.
    pub(super) fn of_cell(cell: &[u8]) -> Vec<TimeFormat> {
        let patterns = PATTERNS.into_iter().map(|pattern| TimeFormat::Pattern(pattern.into()));
        let all = [TimeFormat::Iso, TimeFormat::Clock, TimeFormat::Elapsed];
        let all = all.into_iter().chain(patterns);
        // No number is a time, and most cells are numbers.
        let may_be = cell.contains(&b':')
            || matches!(cell.get(8), Some(b'T' | b'_'))
            || cell.get(10) == Some(&b'_')
            || cell.get(8) == Some(&b',');
        let is_it = |it: &TimeFormat| match it {
            // Hours and minutes look like minutes and seconds.
            TimeFormat::Pattern(pattern) if !has(pattern, HOUR) && !cell.contains(&b'.') => false,
            TimeFormat::Pattern(pattern)
                if pattern == DOTTED_CLOCK && cell.get(8) != Some(&b',') =>
            {
                false
            }
            // Within a day it is a clock's.
            TimeFormat::Elapsed if DayClock::new(&TimeFormat::Clock).seconds(cell).is_some() => {
                false
            }
            _ => DayClock::new(it).seconds(cell).is_some(),
        };
        all.filter(|it| may_be && is_it(it)).collect()
    }
}

/// The marks of a pattern that stand for a part of a time.
const DAY: &[char] = &['d', 'e', 'F', 'D'];
const MONTH: &[char] = &['m', 'b', 'B', 'F', 'D'];
const YEAR: &[char] = &['Y', 'y', 'F', 'D'];
const HOUR: &[char] = &['H', 'I', 'k', 'l', 'T', 'R', 'r'];
const MINUTE: &[char] = &['M'];
const SECOND: &[char] = &['S'];
/// The end of a pattern that says which half of the day it is.
const HALF: &str = "%p";

/// Returns a pattern without its half of the day, before which a fraction may stand.
fn without_half(pattern: &str) -> &str {
    pattern.strip_suffix(HALF).map_or(pattern, str::trim_end)
}

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
    /// Items before the fraction of the second; for [`TimeFormat::Iso`] date and clock time.
    items: Vec<OwnedFormatItem>,
    first_day: Option<i64>,
    last_s: Option<f64>,
}

impl DayClock {
    pub fn new(format: &TimeFormat) -> Self {
        let patterns: &[&str] = match format {
            TimeFormat::Iso => &["%Y-%m-%d", "%H:%M:%S"],
            TimeFormat::Clock | TimeFormat::Elapsed => &["%-H:%M:%S"],
            TimeFormat::Pattern(pattern) => &[without_half(pattern)],
        };
        let items = patterns.iter().filter_map(|pattern| compiled(pattern)).collect();
        DayClock { format: format.clone(), items, first_day: None, last_s: None }
    }

    /// Returns the format that it reads.
    pub fn format(&self) -> &TimeFormat {
        &self.format
    }

    /// Returns the day of the first row, counted from 1970-01-01; `None` where the times hold no date.
    pub fn first_day(&self) -> Option<i64> {
        self.first_day
    }

    /// Returns a cell's time in s since the midnight before the first row; `None` for a cell that is no such time.
    pub fn seconds(&mut self, cell: &[u8]) -> Option<f64> {
        let (day, of_day_s) = self.read(cell)?;
        let time_s = match day {
            Some(day) => {
                let day = day + (of_day_s / DAY_S).floor() as i64;
                let of_day_s = of_day_s.rem_euclid(DAY_S);
                let first = *self.first_day.get_or_insert(day);
                (day - first) as f64 * DAY_S + of_day_s
            }
            None if self.format == TimeFormat::Elapsed => of_day_s,
            // The day, or the hour, in which it is nearest to the row before.
            None => {
                let last_s = self.last_s.unwrap_or(of_day_s);
                let turn_s = match &self.format {
                    TimeFormat::Pattern(pattern) if !has(pattern, HOUR) => 3600.0,
                    _ => DAY_S,
                };
                of_day_s + turn_s * ((last_s - of_day_s) / turn_s).round()
            }
        };
        self.last_s = Some(time_s);
        Some(time_s)
    }

    /// Returns the day, where the cell holds it, and the second of it, in UTC.
    fn read(&self, cell: &[u8]) -> Option<(Option<i64>, f64)> {
        if self.format == TimeFormat::Elapsed {
            return Some((None, elapsed_s(cell)?));
        }
        // Spreadsheets mark a text so.
        let cell = cell.strip_prefix(b"'").unwrap_or(cell);
        let mut parsed = Parsed::new();
        let (mut padded, mut half) = (Cow::Borrowed(cell), None);
        if let TimeFormat::Pattern(pattern) = &self.format {
            if pattern.ends_with(HALF) {
                let (clock, is_afternoon) = split_half(cell)?;
                (padded, half) = (clock.into(), Some(is_afternoon));
            }
            if pattern == PACKED_CLOCK {
                padded = with_zeros(cell)?.into();
            }
            if !has(pattern, HOUR) {
                parsed.set_hour_24(0)?;
            }
        }
        if let Some(is_afternoon) = half {
            parsed.set_hour_12_is_pm(is_afternoon)?;
        }
        let mut rest = &padded[..];
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

/// Returns the day of a cell that holds a date and no time, counted from 1970-01-01.
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

/// Returns the seconds of a time since a start: days in words, hours of any number, minutes and seconds.
fn elapsed_s(cell: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(cell).ok()?;
    let (sign, text) = text.strip_prefix('-').map_or((1.0, text), |rest| (-1.0, rest));
    let (days, clock) = match text.split_once(" day") {
        Some((days, clock)) => {
            (days.parse::<f64>().ok()?, clock.trim_start_matches(['s', ',', ' ']))
        }
        None => (0.0, text),
    };
    let mut parts = clock.trim_start_matches('+').split(':');
    let mut part = || parts.next()?.parse::<f64>().ok().filter(|it| *it >= 0.0);
    let (hours, minutes, seconds) = (part()?, part()?, part()?);
    let is_clock = parts.next().is_none() && minutes < 60.0 && seconds < 60.0 && hours < 1e6;
    is_clock.then_some(sign * days * DAY_S + sign * (hours * 3600.0 + minutes * 60.0 + seconds))
}

/// Returns a cell without its half of the day, and whether that is the second one.
fn split_half(cell: &[u8]) -> Option<(&[u8], bool)> {
    let folded: Vec<u8> = cell.to_ascii_lowercase();
    let halves: [(&[u8], bool); 4] =
        [(b"am", false), (b"pm", true), (b"a.m.", false), (b"p.m.", true)];
    halves.into_iter().find_map(|(word, is_afternoon)| {
        let clock = folded.strip_suffix(word)?;
        Some((cell[..clock.len()].trim_ascii_end(), is_afternoon))
    })
}

/// Packed hours, minutes and seconds with the zeros that a number loses before them.
fn with_zeros(cell: &[u8]) -> Option<Vec<u8>> {
    let digits = cell.iter().take_while(|it| it.is_ascii_digit()).count();
    let zeros = 6_usize.checked_sub(digits).filter(|_| digits > 0)?;
    Some([&b"000000"[..zeros], cell].concat())
}

/// Returns the fraction of a second that a point, a comma, an underscore, or a colon before thousandths begins, or that
/// follows as further digits, 0 without one; and the text after it.
fn fraction(text: &[u8]) -> Option<(f64, &[u8])> {
    let thousandths = text.strip_prefix(b":").filter(|it| it.len() >= 3);
    let more = Some(text).filter(|it| it.first().is_some_and(u8::is_ascii_digit));
    let marked = text.split_first().filter(|it| b".,_".contains(it.0)).map(|it| it.1);
    let Some(digits) = marked.or(thousandths).or(more) else {
        return Some((0.0, text));
    };
    let count = digits.iter().take_while(|it| it.is_ascii_digit()).count();
    let (digits, rest) = digits.split_at(count);
    let value: f64 = std::str::from_utf8(digits).ok().filter(|it| it.len() <= 15)?.parse().ok()?;
    Some((value / 10_f64.powi(count as i32), rest))
}

/// Returns a zone's offset in s: none, `Z`, `UTC`, or as `+01:00`, `+0100`, with or without a space before or a name
/// behind.
fn zone_s(text: &[u8]) -> Option<f64> {
    // Its name may stand behind it in brackets.
    let text = match text.iter().position(|it| *it == b'[') {
        Some(at) if text.ends_with(b"]") => &text[..at],
        _ => text,
    };
    let (sign, digits) = match text.trim_ascii_start() {
        b"" | b"Z" | b"UTC" | b"GMT" => return Some(0.0),
        b"CET" | b"MEZ" | b"BST" => return Some(3600.0),
        b"CEST" | b"MESZ" => return Some(7200.0),
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

/// Returns the second since 1970 at which a TOML date or time begins; `None` for a mere time of day, or a day
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
mod tests;
