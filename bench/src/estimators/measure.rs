//! Timing of an estimator, in rounds; and of another build of this program next to this one: the cost of a change of an
//! estimator.
//!
//! The clock is the thread's processor time, without the time of other programs. Both programs measure the same cases
//! by turns, each in a process of its own; ratios and differences are taken round by round.

use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};
use serde_json::Value;

use crate::ending::{is_due, until_due};
use crate::output::{BenchError, Record};
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

/// Rounds of both programs.
const ROUNDS: usize = 31;

/// Measures the cases whose name contains `case` in this program and in another: the median times of an update in ns,
/// and over the rounds the medians of the difference and of the ratio of this build's time to the other's.
///
/// # Errors
///
/// When one of them cannot be run, or has no such case.
pub fn against(other: &Path, case: &str) -> Result<Vec<Record>, BenchError> {
    let ours = std::env::current_exe()?;
    let mut rounds: Vec<[Vec<(String, f64)>; 2]> = Vec::with_capacity(ROUNDS);
    for round in until_due(0..ROUNDS) {
        // The program that runs first alternates from round to round.
        let (first, then) = if round % 2 == 0 { (&*ours, other) } else { (other, &*ours) };
        match times(first, case).and_then(|first| Ok([first, times(then, case)?])) {
            // The same signal ends the programs of the round.
            Err(_) if is_due() => break,
            Ok([first, then]) if round % 2 == 0 => rounds.push([first, then]),
            Ok([first, then]) => rounds.push([then, first]),
            Err(failure) => return Err(failure),
        }
    }
    let Some(first) = rounds.first() else {
        return Err("ended before the first round was over".into());
    };
    let named = |all: &[(String, f64)], name: &str| {
        all.iter().find(|(other, _)| other == name).map(|&(_, ns)| ns)
    };
    let names = first[0].iter().map(|(name, _)| name.clone());
    Ok(names
        .filter_map(|name| {
            let pairs = rounds.iter().map(|[a, b]| Some((named(a, &name)?, named(b, &name)?)));
            Some(record(&name, &pairs.collect::<Option<Vec<_>>>()?))
        })
        .collect())
}

fn record(name: &str, pairs: &[(f64, f64)]) -> Record {
    let of = |of: fn(&(f64, f64)) -> f64| quartiles(pairs.iter().map(of).collect());
    let [low, ratio, high] = of(|(ours, other)| ours / other);
    Record::default()
        .with("case", name)
        .number("ns", of(|pair| pair.0)[1], 1)
        .number("other ns", of(|pair| pair.1)[1], 1)
        .number("more ns", of(|(ours, other)| ours - other)[1], 1)
        .number("ratio", ratio, 2)
        .number("ratio_low", low, 2)
        .number("ratio_high", high, 2)
}

/// One measurement of a program: cases by name with the time of an update in ns.
fn times(program: &Path, case: &str) -> Result<Vec<(String, f64)>, BenchError> {
    let failed = |came: String| -> BenchError {
        let program = program.display();
        format!("{program}: expected the times of the cases as JSON, {came}").into()
    };
    let arguments = ["estimators", "--quick", "--case", case, "--json", "-"];
    let output = Command::new(program).args(arguments).output();
    let output = output.map_err(|error| failed(error.to_string()))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(failed(format!("{}: {}", output.status, said.trim())));
    }
    let answer: Value =
        serde_json::from_slice(&output.stdout).map_err(|error| failed(error.to_string()))?;
    let cases = answer["cases"].as_array().ok_or_else(|| failed("none came".into()))?;
    let time = |it: &Value| Some((it["case"].as_str()?.to_owned(), it["ns"].as_f64()?));
    cases
        .iter()
        .map(time)
        .collect::<Option<Vec<_>>>()
        .ok_or_else(|| failed("a case without name or time came".into()))
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

    #[test]
    fn ratios_are_taken_round_by_round_and_a_program_that_measures_nothing_is_named() {
        let pairs = [(100.0, 50.0), (120.0, 60.0), (90.0, 45.0)];
        let case = record("case", &pairs);
        assert_eq!((case.value("ratio"), case.value("more ns")), (Some(2.0), Some(50.0)));
        let error = times(Path::new("/bin/true"), "rls").unwrap_err();
        assert!(error.to_string().starts_with("/bin/true: expected the times"), "{error}");
    }
}
