//! The times as a table and for machines.

use std::fmt::Write;

use serde::Serialize;

use super::measure::{CaseTimes, PeerTime, Spread};

/// Everything that was measured.
#[derive(Debug, Serialize)]
pub struct Report {
    /// One entry for each contender; a peer follows ours.
    pub cases: Vec<Entry>,
}

/// Time of one contender.
#[derive(Debug, Serialize)]
pub struct Entry {
    /// Name of the work; a peer's with its own name in brackets.
    pub name: String,
    /// True for a peer.
    pub peer: bool,
    /// Median over the rounds in ns.
    pub ns_per_update: f64,
    /// Quartiles over the rounds in ns.
    pub quartiles_ns: [f64; 2],
    /// Median over the rounds of the peer's time over ours; absent for ours.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peer_over_ours: Option<f64>,
    /// What is aimed at, in ns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_ns: Option<f64>,
    /// Whether the median meets it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub meets_target: Option<bool>,
}

impl Report {
    /// The entries of all cases.
    pub fn of(times: &[CaseTimes]) -> Self {
        let entry = |name: String, ns: &Spread| Entry {
            name,
            peer: false,
            ns_per_update: ns.median,
            quartiles_ns: [ns.low, ns.high],
            peer_over_ours: None,
            target_ns: None,
            meets_target: None,
        };
        let of_case = |case: &CaseTimes| {
            let ours = Entry {
                target_ns: case.target_ns,
                meets_target: meets_target(case),
                ..entry(case.name.clone(), &case.ours_ns)
            };
            let peers = case.peers.iter().map(|peer| Entry {
                peer: true,
                peer_over_ours: Some(peer.ratio.median),
                ..entry(format!("{} ({})", case.name, peer.name), &peer.ns)
            });
            std::iter::once(ours).chain(peers).collect::<Vec<_>>()
        };
        Report { cases: times.iter().flat_map(of_case).collect() }
    }
}

fn meets_target(case: &CaseTimes) -> Option<bool> {
    case.target_ns.map(|target_ns| case.ours_ns.median < target_ns)
}

const HEADINGS: [&str; 8] =
    ["case", "ours ns", "spread", "target ns", "met", "peer", "peer ns", "peer / ours"];

/// Aligned columns, one line for each peer.
pub fn table(times: &[CaseTimes]) -> String {
    let mut lines = vec![HEADINGS.map(String::from)];
    for case in times {
        let mut peers = case.peers.iter();
        lines.push(line(case, peers.next(), true));
        lines.extend(peers.map(|peer| line(case, Some(peer), false)));
    }
    let widths: [usize; 8] = std::array::from_fn(|column| {
        lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0)
    });
    let mut text = String::new();
    for line in &lines {
        let mut row = String::new();
        for (column, (cell, width)) in line.iter().zip(widths).enumerate() {
            // Names to the left, numbers to the right.
            let _ = match column {
                0 | 5 => write!(row, "{cell:<width$}  "),
                _ => write!(row, "{cell:>width$}  "),
            };
        }
        text.push_str(row.trim_end());
        text.push('\n');
    }
    text
}

fn line(case: &CaseTimes, peer: Option<&PeerTime>, is_first: bool) -> [String; 8] {
    let first = |text: String| if is_first { text } else { String::new() };
    let met = meets_target(case).map_or("", |met| if met { "yes" } else { "NO" });
    [
        first(case.name.clone()),
        first(nanoseconds(case.ours_ns.median)),
        first(format!("{:.0} %", 100.0 * case.ours_ns.relative())),
        first(case.target_ns.map_or(String::new(), nanoseconds)),
        first(met.into()),
        peer.map_or(String::new(), |peer| peer.name.clone()),
        peer.map_or(String::new(), |peer| nanoseconds(peer.ns.median)),
        peer.map_or(String::new(), |peer| format!("{:.2}", peer.ratio.median)),
    ]
}

/// With groups of thousands; a digit after the point below 100.
fn nanoseconds(value: f64) -> String {
    if value < 100.0 {
        return format!("{value:.1}");
    }
    let digits = format!("{value:.0}");
    let mut grouped = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            grouped.push(' ');
        }
        grouped.push(digit);
    }
    grouped
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

    #[test]
    fn peers_follow_ours_and_only_ours_has_a_target() {
        let ns = Spread { low: 9.0, median: 10.0, high: 12.0 };
        let peer = PeerTime { name: "p".into(), ns, ratio: Spread { low: 2.0, ..ns } };
        let case =
            CaseTimes { name: "c".into(), target_ns: Some(11.0), ours_ns: ns, peers: vec![peer] };
        let report = Report::of(std::slice::from_ref(&case));
        assert_eq!(report.cases[0].meets_target, Some(true));
        assert_eq!(report.cases[1].name, "c (p)");
        assert!(report.cases[1].peer && report.cases[1].target_ns.is_none());
        assert!(table(&[case]).lines().count() == 2);
    }
}
