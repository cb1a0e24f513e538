//! The comparison as a table.

use super::promise::Verdict;
use super::row::Row;
use crate::output::Record;

/// Where a note begins in a quantity.
const NOTES: [&str; 6] =
    [" (paper's method:", "; paper's method:", " (baseline:", "; baseline:", " (EM:", "; EM:"];

/// A row for people and for a file of CSV. What stands behind a quantity, from `paper's method:` or `baseline:` on,
/// is a note.
pub fn record(row: &Row, verdict: &Verdict) -> Record {
    let (quantity, mut notes) = match NOTES.iter().filter_map(|it| row.quantity.find(it)).min() {
        Some(at) => {
            let note = row.quantity[at..].trim_start_matches([' ', '(', ';']);
            (&row.quantity[..at], vec![note.trim_end_matches(')').to_owned()])
        }
        None => (&row.quantity[..], Vec::new()),
    };
    if !verdict.broken.is_empty() {
        notes.push(format!("BROKEN: {}", verdict.broken.join(", ")));
    } else if let Some(reason) = verdict.may_be_wider.filter(|_| !verdict.promised.is_empty()) {
        notes.push(format!("may be wider: {reason}"));
    }
    let ratio = row.ours.zip(row.bound).filter(|(_, bound)| *bound > 0.0);
    let band = verdict.nees_band.filter(|_| row.nees.is_some());
    Record::default()
        .with("paper", row.paper)
        .with("table", row.table)
        .with("quantity", quantity)
        .with("unit", row.unit)
        .with("published", figure(row.published))
        .with("papers_method", figure(row.paper_method))
        .with("baseline", figure(row.baseline))
        .with("ours", figure(row.ours))
        .with("bound", figure(row.bound))
        .number("ours_over_bound", ratio.map(|(ours, bound)| ours / bound), 2)
        .number("coverage_percent", row.coverage.map(|share| 100.0 * share), 1)
        .number("nees", row.nees, 2)
        .number("nees_low", band.map(|it| it.0), 2)
        .number("nees_high", band.map(|it| it.1), 2)
        .with("seeds", row.seeds)
        .with("note", notes.join("; "))
}

/// Three significant digits, in scientific form where a plain one would be long.
fn figure(value: Option<f64>) -> String {
    let Some(value) = value else { return String::new() };
    if value == 0.0 {
        return "0".into();
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-4..=5).contains(&exponent) {
        return format!("{value:.2e}");
    }
    format!("{value:.*}", (2 - exponent).max(0) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::papers::seeds::Seeds;

    fn row() -> Row {
        Row {
            published: Some(0.04),
            ours: Some(0.0297),
            bound: Some(0.027),
            coverage: Some(0.951),
            ..Row::new(
                "Xia 2023",
                "Table 3",
                "w0 over driven speeds",
                "N/kN",
                Seeds::from_zero(200),
            )
        }
    }

    #[test]
    fn figures_stand_apart_from_notes() {
        let row = Row { quantity: "mass, 3 km (paper's method: by hand)".into(), ..row() };
        let record = record(&row, &Verdict::of(&row));
        let of = |name: &str| record.cell(name).unwrap();
        assert_eq!((of("quantity"), of("note")), ("mass, 3 km", "paper's method: by hand"));
        assert_eq!((of("ours_over_bound"), of("coverage_percent")), ("1.10", "95.1"));
        assert_eq!((of("baseline"), of("nees")), ("", ""));
    }

    #[test]
    fn figures_have_three_significant_digits() {
        let cases = [(4.1e-10, "4.10e-10"), (0.02971, "0.0297"), (56.04, "56.0"), (3085.5, "3086")];
        for (value, expected) in cases {
            assert_eq!(figure(Some(value)), expected);
        }
        assert_eq!(figure(None), "");
    }
}
