//! A time in UTC, to the second, as records show it.

use std::fmt;
use std::str::FromStr;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use time::format_description::well_known::Rfc3339;
use time::{OffsetDateTime, PrimitiveDateTime};

/// A second of UTC, written as in RFC 3339: `2026-11-23T05:20:00Z`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct UtcSecond {
    /// Seconds since 1970.
    pub unix_s: u64,
}

/// A text that is no time.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?}: expected a time in UTC, as 2026-11-23T05:20:00Z")]
pub struct NoMoment(String);

impl UtcSecond {
    /// Returns the second in which an instant lies; the first second of 1970 for an instant before it.
    pub fn from_time(instant: SystemTime) -> Self {
        UtcSecond { unix_s: instant.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs()) }
    }

    /// Returns its beginning.
    pub fn instant(self) -> SystemTime {
        UNIX_EPOCH + Duration::from_secs(self.unix_s)
    }

    /// Returns its day, as year-month-day.
    pub fn day(self) -> String {
        self.in_calendar().date().to_string()
    }

    /// Returns the end of the year 9999 for later times: a wrong clock must not end the program.
    fn in_calendar(self) -> OffsetDateTime {
        let unix_s = i64::try_from(self.unix_s).unwrap_or(i64::MAX);
        let last = PrimitiveDateTime::MAX.assume_utc();
        OffsetDateTime::from_unix_timestamp(unix_s).unwrap_or(last)
    }
}

impl fmt::Display for UtcSecond {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = self.in_calendar();
        let (day, hour, minute, second) = (at.date(), at.hour(), at.minute(), at.second());
        write!(f, "{day}T{hour:02}:{minute:02}:{second:02}Z")
    }
}

impl FromStr for UtcSecond {
    type Err = NoMoment;

    fn from_str(text: &str) -> Result<Self, NoMoment> {
        let none = || NoMoment(text.into());
        let at = OffsetDateTime::parse(text, &Rfc3339).map_err(|_| none())?;
        let moment = UtcSecond { unix_s: at.unix_timestamp().try_into().map_err(|_| none())? };
        // Another offset, or a part of a second, would read back as another text.
        if moment.to_string() == text { Ok(moment) } else { Err(none()) }
    }
}

impl TryFrom<String> for UtcSecond {
    type Error = NoMoment;

    fn try_from(text: String) -> Result<Self, NoMoment> {
        text.parse()
    }
}

impl From<UtcSecond> for String {
    fn from(moment: UtcSecond) -> String {
        moment.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_reads_back_as_it_is_shown() {
        for unix_s in (0..4_102_444_800).step_by(39_999_983) {
            let moment = UtcSecond { unix_s };
            assert_eq!(moment.to_string().parse(), Ok(moment));
        }
        let moment = UtcSecond::from_time(UNIX_EPOCH + Duration::from_millis(1_772_323_199_999));
        assert_eq!(moment.to_string(), "2026-02-28T23:59:59Z");
        assert_eq!(moment.day(), "2026-02-28");
        let days = [0, 11_016, 11_017, 20_453].map(|day| UtcSecond { unix_s: 86_400 * day }.day());
        assert_eq!(days, ["1970-01-01", "2000-02-29", "2000-03-01", "2025-12-31"]);
        assert_eq!(UtcSecond { unix_s: u64::MAX }.to_string(), "9999-12-31T23:59:59Z");
        for wrong in
            ["", "2026-02-30T00:00:00Z", "2026-02-28T00:00:00+01:00", "0000-01-01T00:00:00Z"]
        {
            assert!(wrong.parse::<UtcSecond>().is_err(), "{wrong}");
        }
    }
}
