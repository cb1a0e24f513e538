//! Results of the day as a table with a row for each hour.

use std::fmt::Write;

use super::train::TrainAccount;

/// Counts of an hour of the day.
#[derive(Clone, Debug, Default)]
pub struct Hour {
    /// Greatest resident memory of the daemon in KiB.
    pub resident_kib: u64,
    /// Samples published, once for each pipeline.
    pub offered: u64,
    /// Samples used, rejected and lost, over all pipelines.
    pub account: TrainAccount,
    /// Median time in ns from sample to snapshot, with 16 samples of each train on their way.
    pub latency_p50_ns: u64,
    /// The time in ns that one in a thousand exceeds.
    pub latency_p999_ns: u64,
    /// Daemons started.
    pub starts: u64,
    /// Trains whose state on the disk was whole at the end.
    pub whole_states: usize,
}

/// Returns the median and 99.9th percentile.
pub fn quantiles(mut values: Vec<u64>) -> (u64, u64) {
    values.sort_unstable();
    let at = |share: f64| {
        let index = (values.len() as f64 * share) as usize;
        values.get(index).copied().unwrap_or(0)
    };
    (at(0.5), at(0.999))
}

/// Returns the hours as a table for people.
pub fn table(hours: &[Hour]) -> String {
    let mut text = String::from(
        "hour  resident MiB     offered        used   rejected      lost  p50 µs  p99.9 µs  starts  states\n",
    );
    for (number, hour) in hours.iter().enumerate() {
        let [used, rejected, lost] = hour.account;
        writeln!(
            text,
            "{number:4}  {:12.1}  {:10}  {used:10}  {rejected:9}  {lost:8}  {:6.0}  {:8.0}  {:6}  {:6}",
            hour.resident_kib as f64 / 1024.0,
            hour.offered,
            hour.latency_p50_ns as f64 / 1e3,
            hour.latency_p999_ns as f64 / 1e3,
            hour.starts,
            hour.whole_states,
        )
        .expect("a String takes everything");
    }
    text
}
