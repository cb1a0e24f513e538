//! Histograms of latencies, and what is reported of them.

use hdrhistogram::Histogram;
use serde::Serialize;

use crate::output::Record;

/// The longest latency resolved, in ns.
const LONGEST_NS: u64 = 60_000_000_000;

/// A histogram of latencies from 1 ns to a minute, to three digits.
///
/// # Panics
///
/// Never: the bounds are constants that the library takes.
pub fn histogram() -> Histogram<u64> {
    Histogram::new_with_bounds(1, LONGEST_NS, 3).expect("constant bounds")
}

/// Adds a latency; one below 1 ns or above a minute counts as that.
pub fn record(histogram: &mut Histogram<u64>, latency_ns: i64) {
    histogram.saturating_record(latency_ns.clamp(1, LONGEST_NS as i64) as u64);
}

/// What is reported of a histogram, in ns.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantiles {
    /// Number of latencies.
    pub count: u64,
    /// Median.
    pub p50_ns: u64,
    /// 99 %.
    pub p99_ns: u64,
    /// 99.9 %.
    pub p999_ns: u64,
    /// 99.99 %.
    pub p9999_ns: u64,
    /// The longest.
    pub max_ns: u64,
}

impl Quantiles {
    /// Of a histogram.
    pub fn of(histogram: &Histogram<u64>) -> Self {
        Quantiles {
            count: histogram.len(),
            p50_ns: histogram.value_at_quantile(0.5),
            p99_ns: histogram.value_at_quantile(0.99),
            p999_ns: histogram.value_at_quantile(0.999),
            p9999_ns: histogram.value_at_quantile(0.9999),
            max_ns: histogram.max(),
        }
    }
}

/// Cells of a table: the quantiles of latencies.
pub fn cells(record: Record, it: &Quantiles) -> Record {
    [
        ("p50", it.p50_ns),
        ("p99", it.p99_ns),
        ("p99.9", it.p999_ns),
        ("p99.99", it.p9999_ns),
        ("max", it.max_ns),
    ]
    .into_iter()
    .fold(record, |record, (name, ns)| record.with(name, for_people(ns as f64)))
}

/// All of some histograms with the bounds of [`histogram`].
pub fn pooled<'a>(histograms: impl IntoIterator<Item = &'a Histogram<u64>>) -> Histogram<u64> {
    let mut all = histogram();
    for own in histograms {
        // Every histogram has the same bounds.
        let _ = all.add(own);
    }
    all
}

/// A time in ns for people: `812 ns`, `4.31 µs`, `2.20 ms`.
pub fn for_people(ns: f64) -> String {
    match ns {
        ns if ns < 1e3 => format!("{ns:.0} ns"),
        ns if ns < 1e6 => format!("{:.2} µs", ns * 1e-3),
        ns if ns < 1e9 => format!("{:.2} ms", ns * 1e-6),
        ns => format!("{:.2} s", ns * 1e-9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_a_thousand_steps_are_the_steps() {
        let mut steps = histogram();
        for ns in 1..=1000 {
            record(&mut steps, ns);
        }
        let quantiles = Quantiles::of(&steps);
        assert_eq!((quantiles.count, quantiles.max_ns), (1000, 1000));
        assert_eq!((quantiles.p50_ns, quantiles.p99_ns, quantiles.p999_ns), (500, 990, 999));
    }

    #[test]
    fn a_clock_that_seems_to_run_back_counts_as_one_nanosecond() {
        let mut histogram = histogram();
        record(&mut histogram, -5);
        assert_eq!(histogram.max(), 1);
    }

    #[test]
    fn times_are_reported_in_a_fitting_unit() {
        let printed = [812.0, 4_310.0, 2.2e6].map(for_people);
        assert_eq!(printed, ["812 ns", "4.31 µs", "2.20 ms"]);
    }
}
