//! Moments: a second of UTC as records show it, and a stamp whose age is right in another process too, even when the
//! wall clock is set.

use std::fmt;
use std::str::FromStr;
use std::sync::LazyLock;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};
use time::format_description::well_known::Rfc3339;
use time::{OffsetDateTime, PrimitiveDateTime};

/// A moment by both clocks of a host.
///
/// Between two moments of one start of the system the clock that nobody sets counts; between moments of different
/// starts the wall clock counts.
#[derive(Clone, Debug, PartialEq)]
pub struct Stamp {
    /// Seconds since 1970 by the wall clock.
    pub unix_s: f64,
    /// The same moment since the system's start; absent where that is unknown.
    pub since_boot: Option<SinceBoot>,
}

/// A moment since a start of the system.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SinceBoot {
    /// The kernel's identifier of that start (`/proc/sys/kernel/random/boot_id`).
    pub boot_id: String,
    /// Seconds since then, sleep included (`CLOCK_BOOTTIME`).
    pub elapsed_s: f64,
}

static BOOT_ID: LazyLock<Option<String>> = LazyLock::new(|| {
    let text = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?;
    Some(text.trim().to_owned())
});

impl Stamp {
    /// Returns the present moment.
    pub fn now() -> Self {
        let unix = SystemTime::now().duration_since(UNIX_EPOCH);
        let boot = clock_gettime(ClockId::Boottime);
        let elapsed_s = boot.tv_sec as f64 + 1e-9 * boot.tv_nsec as f64;
        Stamp {
            unix_s: unix.map_or(0.0, |since| since.as_secs_f64()),
            since_boot: BOOT_ID.clone().map(|boot_id| SinceBoot { boot_id, elapsed_s }),
        }
    }

    /// Returns the moment that lies this many seconds later.
    pub fn after_s(mut self, seconds: f64) -> Self {
        self.unix_s += seconds;
        if let Some(since_boot) = &mut self.since_boot {
            since_boot.elapsed_s += seconds;
        }
        self
    }

    /// Returns the seconds from this moment to another one, negative where that lies before.
    pub fn seconds_to(&self, other: &Stamp) -> f64 {
        match (&self.since_boot, &other.since_boot) {
            (Some(from), Some(to)) if from.boot_id == to.boot_id => to.elapsed_s - from.elapsed_s,
            _ => other.unix_s - self.unix_s,
        }
    }
}

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
    fn the_wall_clock_counts_only_between_starts_of_the_system() {
        let at = |unix_s, boot: Option<(&str, f64)>| Stamp {
            unix_s,
            since_boot: boot.map(|it| SinceBoot { boot_id: it.0.into(), elapsed_s: it.1 }),
        };
        let from = at(1000.0, Some(("a", 50.0)));
        assert_eq!(from.seconds_to(&at(90_000.0, Some(("a", 60.0)))), 10.0);
        assert_eq!(from.seconds_to(&at(-90_000.0, Some(("a", 60.0)))), 10.0);
        assert_eq!(from.seconds_to(&at(1500.0, Some(("b", 60.0)))), 500.0);
        assert_eq!(from.seconds_to(&at(1500.0, None)), 500.0);
        let now = Stamp::now();
        let later = now.clone().after_s(7.0);
        assert!((now.seconds_to(&later) - 7.0).abs() < 1e-6);
        assert!(now.since_boot.is_some() && now.seconds_to(&Stamp::now()) >= 0.0);
    }
}

#[cfg(test)]
mod moment_tests {
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
