//! Moments whose age is right in another process too, even when the wall clock is set.

use std::sync::LazyLock;
use std::time::{SystemTime, UNIX_EPOCH};

use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};

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
