//! Timing of an estimator, in rounds.
//!
//! The clock is the thread's processor time, without the time of other programs.

use std::hint::black_box;
use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};

use crate::output::Record;
use crate::statistics::quantiles;

/// Work that is timed.
pub struct EstimatorCase {
    /// Its name, in the table and in JSON.
    pub name: String,
    /// Target for the time of an update in ns.
    target_ns: Option<f64>,
    /// Updates in a pass.
    updates: usize,
    /// Goes through all data once from a fresh start.
    pass: Box<dyn FnMut()>,
}

/// Extent of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Rounds.
    pub rounds: usize,
    /// Least time of a round.
    pub slice: Duration,
}

impl Effort {
    /// A measurement: odd numbers of rounds have a middle.
    pub const FULL: Effort = Effort { rounds: 31, slice: Duration::from_millis(5) };
    /// A check that everything runs.
    pub const QUICK: Effort = Effort { rounds: 5, slice: Duration::from_millis(1) };
}

/// Lower quartile, median and upper quartile of at least one value.
pub fn quartiles(values: Vec<f64>) -> [f64; 3] {
    quantiles(values, [0.25, 0.5, 0.75]).unwrap_or([f64::NAN; 3])
}

impl EstimatorCase {
    /// Returns a case from its name, the number of updates in a pass, and the pass, which returns its estimates.
    pub fn new<T>(
        name: impl Into<String>,
        updates: usize,
        mut pass: impl FnMut() -> T + 'static,
    ) -> Self {
        let pass = Box::new(move || _ = black_box(pass()));
        EstimatorCase { name: name.into(), target_ns: None, updates, pass }
    }

    /// Returns the case with a target in ns.
    #[must_use]
    pub fn aim(self, target_ns: f64) -> Self {
        EstimatorCase { target_ns: Some(target_ns), ..self }
    }

    /// Warms up and measures: the median time of an update over the rounds, half the distance of its quartiles, and the
    /// target.
    pub fn measure(mut self, effort: &Effort) -> Record {
        let mut passes = 1;
        while self.time(passes) < effort.slice {
            passes *= 2;
        }
        let updates = (passes * self.updates) as f64;
        let times_ns = (0..effort.rounds).map(|_| 1e9 * self.time(passes).as_secs_f64() / updates);
        let [low, median, high] = quartiles(times_ns.collect());
        let met = self.target_ns.map_or("", |most| if median < most { "yes" } else { "NO" });
        Record::default()
            .with("case", &self.name)
            .shown("ns", nanoseconds(median), median)
            .number("spread %", 50.0 * (high - low) / median, 0)
            .shown("target ns", self.target_ns.map_or(String::new(), nanoseconds), self.target_ns)
            .with("met", met)
    }

    /// Measures the time of `passes` passes.
    pub fn time(&mut self, passes: usize) -> Duration {
        let start = now();
        (0..passes).for_each(|_| (self.pass)());
        now().saturating_sub(start)
    }
}

/// Processor time of this thread so far.
fn now() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

/// Three significant digits below 100, groups of thousands above.
fn nanoseconds(value: f64) -> String {
    if value < 100.0 {
        return format!("{value:.1}");
    }
    let digits = format!("{value:.0}").into_bytes();
    let groups = digits.rchunks(3).rev().map(String::from_utf8_lossy);
    groups.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_that_of_an_update_and_is_held_against_its_aim() {
        let sleepy =
            || std::hint::black_box((0..20_000_u64).map(std::hint::black_box).sum::<u64>());
        let of = |updates, target_ns| {
            let effort = Effort { rounds: 3, slice: Duration::ZERO };
            EstimatorCase::new("c", updates, sleepy).aim(target_ns).measure(&effort)
        };
        let (slow, fast) = (of(1, 1.0), of(1000, 1e9));
        assert_eq!((slow.cell("met"), fast.cell("met")), (Some("NO"), Some("yes")));
        assert!(slow.value("ns") > fast.value("ns"), "{slow:?} {fast:?}");
    }

    #[test]
    fn thousands_are_grouped() {
        assert_eq!(nanoseconds(41.26), "41.3");
        assert_eq!(nanoseconds(987.6), "988");
        assert_eq!(nanoseconds(1_234_567.0), "1 234 567");
    }
}
