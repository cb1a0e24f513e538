//! A time in UTC, to the second, as records show it.

use std::fmt;
use std::str::FromStr;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use toml::value::Datetime;

use crate::report::provenance::day;

/// Seconds of a day.
const DAY_S: u64 = 86_400;

/// A second of UTC, written as RFC 3339 has it: `2026-11-23T05:20:00Z`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Moment {
    /// Seconds since 1970.
    pub unix_s: u64,
}

/// A text that is no time.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?}: expected a time in UTC, as 2026-11-23T05:20:00Z")]
pub struct NoMoment(String);

impl Moment {
    /// The second in which an instant lies; the first of 1970 for one before.
    pub fn of(instant: SystemTime) -> Self {
        Moment { unix_s: instant.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs()) }
    }

    /// Its beginning.
    pub fn instant(self) -> SystemTime {
        UNIX_EPOCH + Duration::from_secs(self.unix_s)
    }
}

impl fmt::Display for Moment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (day, s) = (day(self.instant()), self.unix_s % DAY_S);
        write!(f, "{day}T{:02}:{:02}:{:02}Z", s / 3600, s / 60 % 60, s % 60)
    }
}

impl FromStr for Moment {
    type Err = NoMoment;

    fn from_str(text: &str) -> Result<Self, NoMoment> {
        let none = || NoMoment(text.into());
        let read: Datetime = text.parse().map_err(|_| none())?;
        let (Some(date), Some(time)) = (read.date.filter(|it| it.year >= 1970), read.time) else {
            return Err(none());
        };
        // Years that begin in March put the leap day last.
        let (year, month) = (u64::from(date.year), u64::from(date.month));
        let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
        let days = 365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5;
        let days = days + u64::from(date.day) - 1 - 719_468;
        let minutes = 60 * u64::from(time.hour) + u64::from(time.minute);
        let second = u64::from(time.second.unwrap_or(0));
        let moment = Moment { unix_s: DAY_S * days + 60 * minutes + second };
        // Another offset, or a day that is none, would read back as another text.
        if moment.to_string() == text { Ok(moment) } else { Err(none()) }
    }
}

impl TryFrom<String> for Moment {
    type Error = NoMoment;

    fn try_from(text: String) -> Result<Self, NoMoment> {
        text.parse()
    }
}

impl From<Moment> for String {
    fn from(moment: Moment) -> String {
        moment.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_reads_back_as_it_is_shown() {
        for unix_s in (0..4_102_444_800).step_by(39_999_983) {
            let moment = Moment { unix_s };
            assert_eq!(moment.to_string().parse(), Ok(moment));
        }
        let moment = Moment::of(UNIX_EPOCH + Duration::from_millis(1_772_323_199_999));
        assert_eq!(moment.to_string(), "2026-02-28T23:59:59Z");
        for wrong in
            ["", "2026-02-30T00:00:00Z", "2026-02-28T00:00:00+01:00", "0000-01-01T00:00:00Z"]
        {
            assert!(wrong.parse::<Moment>().is_err(), "{wrong}");
        }
    }
}
