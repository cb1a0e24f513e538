//! Means, quantiles and differences over seeded runs; histograms of latencies, and their reported quantiles.

use std::borrow::Borrow;

use hdrhistogram::Histogram;

use crate::output::Record;

/// m/s of one km/h.
pub const KMH: f64 = 1.0 / 3.6;

/// Returns the arithmetic mean; 0 for no values.
pub fn mean(values: impl IntoIterator<Item: Borrow<f64>>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for value in values {
        sum += value.borrow();
        count += 1;
    }
    if count == 0 { 0.0 } else { sum / f64::from(count) }
}

/// Returns the share of true values; 0 for no values.
pub fn share(are_so: impl IntoIterator<Item = bool>) -> f64 {
    mean(are_so.into_iter().map(|is_so| f64::from(u8::from(is_so))))
}

/// Returns the root mean square; 0 for no values.
pub fn root_mean_square(values: impl IntoIterator<Item: Borrow<f64>>) -> f64 {
    mean(values.into_iter().map(|value| value.borrow() * value.borrow())).sqrt()
}

/// Returns the values that these shares of all values do not exceed; `None` for no values.
pub fn quantiles<const N: usize>(mut values: Vec<f64>, shares: [f64; N]) -> Option<[f64; N]> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)? as f64;
    Some(shares.map(|share| values[(share * last).round() as usize]))
}

/// Returns the middle of some values, of two the greater one; none of none.
pub fn median(values: Vec<f64>) -> Option<f64> {
    quantiles(values, [0.5]).map(|[middle]| middle)
}

/// Returns a straight line through some points, by least squares: its value at 0, and its slope.
pub fn straight_line(points: &[(f64, f64)]) -> (f64, f64) {
    let (mean_x, mean_y) = (mean(points.iter().map(|it| it.0)), mean(points.iter().map(|it| it.1)));
    let spread: f64 = points.iter().map(|it| (it.0 - mean_x).powi(2)).sum();
    let slope = points.iter().map(|it| (it.0 - mean_x) * (it.1 - mean_y)).sum::<f64>() / spread;
    (mean_y - slope * mean_x, slope)
}

/// Derivatives of every element of a list with respect to each parameter, by central differences of these widths: from
/// the motion of a scenario, independently of the derivatives that estimators use.
pub fn jacobian<const N: usize>(
    widths: [f64; N],
    at: impl Fn([f64; N]) -> Vec<f64>,
) -> Vec<[f64; N]> {
    let mut rows = Vec::new();
    for (column, width) in widths.into_iter().enumerate() {
        let mut change = [0.0; N];
        change[column] = width;
        let (plus, minus) = (at(change), at(change.map(|width| -width)));
        rows.resize(plus.len().max(rows.len()), [0.0; N]);
        for (row, (plus, minus)) in rows.iter_mut().zip(plus.iter().zip(minus)) {
            row[column] = (plus - minus) / (2.0 * width);
        }
    }
    rows
}

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
    fn moments_and_quantiles_of_a_small_set() {
        assert_eq!(root_mean_square([3.0, -4.0]), 12.5_f64.sqrt());
        assert_eq!((mean([1.0, 2.0, 6.0]), mean(&[] as &[f64])), (3.0, 0.0));
        assert_eq!(share([true, false, true, true]), 0.75);
        assert_eq!(straight_line(&[(1.0, 3.0), (2.0, 5.0), (4.0, 9.0)]), (1.0, 2.0));
        let found = quantiles(vec![5.0, 1.0, 100.0, 2.0, 3.0], [0.25, 0.5, 0.75]);
        assert_eq!(found, Some([2.0, 3.0, 5.0]));
        assert_eq!((median(vec![3.0, 1.0, 10.0, 2.0]), median(Vec::new())), (Some(3.0), None));
    }

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
