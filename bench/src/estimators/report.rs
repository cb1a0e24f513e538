//! The times as a table.

use super::measure::Entry;
use crate::output::{Record, table};

/// A row for each contender.
pub fn text(entries: &[Entry]) -> String {
    let row = |entry: &Entry| {
        let [low, high] = entry.quartiles_ns;
        let spread = 50.0 * (high - low) / entry.ns_per_update;
        Record::default()
            .with("case", &entry.name)
            .with("ns", nanoseconds(entry.ns_per_update))
            .number("spread %", spread, 0)
            .with("target ns", entry.target_ns.map_or(String::new(), nanoseconds))
            .with("met", entry.meets_target.map_or("", |met| if met { "yes" } else { "NO" }))
            .number("peer / ours", entry.peer_over_ours, 2)
    };
    table(&entries.iter().map(row).collect::<Vec<_>>())
}

/// Three significant digits below 100, groups of thousands above.
fn nanoseconds(value: f64) -> String {
    if value < 100.0 {
        return format!("{value:.1}");
    }
    let digits = format!("{value:.0}");
    let groups: Vec<&str> = digits.as_bytes().rchunks(3).rev().map(ascii).collect();
    groups.join(" ")
}

fn ascii(digits: &[u8]) -> &str {
    std::str::from_utf8(digits).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_are_grouped() {
        assert_eq!(nanoseconds(41.26), "41.3");
        assert_eq!(nanoseconds(987.6), "988");
        assert_eq!(nanoseconds(1_234_567.0), "1 234 567");
    }
}
