//! Histograms of latencies, and their reported quantiles.

use hdrhistogram::Histogram;

use crate::output::Record;

/// The longest latency resolved, in ns.
const LONGEST_NS: u64 = 60_000_000_000;

/// Returns a histogram of latencies from 1 ns to a minute, to three digits.
///
/// # Panics
///
/// Never: the bounds are constants that the library takes.
pub fn histogram() -> Histogram<u64> {
    Histogram::new_with_bounds(1, LONGEST_NS, 3).expect("constant bounds")
}

/// Adds a latency, limited to the range from 1 ns to a minute.
pub fn record(histogram: &mut Histogram<u64>, latency_ns: i64) {
    histogram.saturating_record(latency_ns.clamp(1, LONGEST_NS as i64) as u64);
}

/// Returns the cells of a table: the quantiles of latencies.
pub fn cells(record: Record, of: &Histogram<u64>) -> Record {
    let at = |quantile: f64| of.value_at_quantile(quantile);
    [
        ("p50_ns", at(0.5)),
        ("p99_ns", at(0.99)),
        ("p99.9_ns", at(0.999)),
        ("p99.99_ns", at(0.9999)),
        ("max_ns", of.max()),
    ]
    .into_iter()
    .fold(record, |record, (name, ns)| record.shown(name, for_people(ns as f64), ns))
}

/// Returns all of some histograms with the bounds of [`histogram`].
pub fn pooled<'a>(histograms: impl IntoIterator<Item = &'a Histogram<u64>>) -> Histogram<u64> {
    let mut all = histogram();
    for own in histograms {
        // Every histogram has the same bounds.
        let _ = all.add(own);
    }
    all
}

/// Returns a time in ns for people: `812 ns`, `4.31 µs`, `2.20 ms`.
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
        let found = cells(Record::default(), &steps);
        let of = |name: &str| found.value(name).unwrap();
        assert_eq!([of("p50_ns"), of("p99_ns"), of("p99.9_ns")], [500.0, 990.0, 999.0]);
        assert_eq!(of("max_ns"), 1000.0);
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
