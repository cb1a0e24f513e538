//! The comparison as text.

use std::fmt::Write;

use super::{Row, Verdict};
use crate::output::{CsvRow, cell};

const HEADINGS: [&str; 13] = [
    "paper",
    "table",
    "quantity",
    "unit",
    "published",
    "paper's method",
    "baseline",
    "ours",
    "bound",
    "ours / bound",
    "coverage",
    "NEES (99 % band)",
    "promise",
];

fn cells(row: &Row) -> [String; 13] {
    let verdict = Verdict::of(row);
    let ratio = row.ours.zip(row.bound).filter(|(_, bound)| *bound > 0.0);
    [
        row.paper.to_owned(),
        row.table.to_owned(),
        row.quantity.clone(),
        row.unit.to_owned(),
        figure(row.published),
        figure(row.paper_method),
        figure(row.baseline),
        figure(row.ours),
        figure(row.bound),
        ratio.map_or(String::new(), |(ours, bound)| format!("{:.2}", ours / bound)),
        row.coverage.map_or(String::new(), |share| format!("{:.1} %", 100.0 * share)),
        nees(row, &verdict),
        match (verdict.promised.is_empty(), verdict.broken.is_empty()) {
            (true, _) => String::new(),
            (false, true) => match verdict.may_be_wider {
                Some(reason) => format!("kept; may be wider: {reason}"),
                None => "kept".into(),
            },
            (false, false) => format!("BROKEN: {}", verdict.broken.join(", ")),
        },
    ]
}

fn nees(row: &Row, verdict: &Verdict) -> String {
    match (row.nees, verdict.nees_band) {
        (Some(nees), Some((low, high))) => format!("{nees:.2} ({low:.2}-{high:.2})"),
        (Some(nees), None) => format!("{nees:.2}"),
        (None, _) => String::new(),
    }
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

/// Aligned columns for a terminal.
pub fn for_terminal(rows: &[Row]) -> String {
    let body: Vec<_> = rows.iter().map(cells).collect();
    let mut widths = HEADINGS.map(|heading| heading.chars().count());
    for line in &body {
        for (width, cell) in widths.iter_mut().zip(line) {
            *width = (*width).max(cell.chars().count());
        }
    }
    let mut text = String::new();
    let headings = HEADINGS.map(str::to_owned);
    for line in std::iter::once(&headings).chain(&body) {
        for (index, (cell, width)) in line.iter().zip(widths).enumerate() {
            // Writing into a String cannot fail.
            let _ = match index {
                0..4 => write!(text, "{cell:<width$}  "),
                _ => write!(text, "{cell:>width$}  "),
            };
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    }
    text
}

/// The rows for a file of CSV. What stands behind a quantity, from `paper's method:` or `baseline:` on, is a note.
pub fn csv(rows: &[Row]) -> Vec<CsvRow> {
    rows.iter().map(csv_row).collect()
}

fn csv_row(row: &Row) -> CsvRow {
    let verdict = Verdict::of(row);
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
    vec![
        ("paper", row.paper.to_owned()),
        ("table", row.table.to_owned()),
        ("quantity", quantity.to_owned()),
        ("unit", row.unit.to_owned()),
        ("published", figure(row.published)),
        ("papers_method", figure(row.paper_method)),
        ("baseline", figure(row.baseline)),
        ("ours", figure(row.ours)),
        ("bound", figure(row.bound)),
        ("ours_over_bound", cell(ratio.map(|(ours, bound)| ours / bound), 2)),
        ("coverage_percent", cell(row.coverage.map(|share| 100.0 * share), 1)),
        ("nees", cell(row.nees, 2)),
        ("nees_low", cell(band.map(|it| it.0), 2)),
        ("nees_high", cell(band.map(|it| it.1), 2)),
        ("seeds", row.seeds.to_string()),
        ("note", notes.join("; ")),
    ]
}

/// Where a note begins in a quantity.
const NOTES: [&str; 6] =
    [" (paper's method:", "; paper's method:", " (baseline:", "; baseline:", " (EM:", "; EM:"];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::papers::Seeds;

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
    fn the_ratio_to_the_bound_is_shown() {
        let text = for_terminal(&[row()]);
        assert!(text.lines().nth(1).unwrap().contains("0.0297  0.0270          1.10    95.1 %"));
    }

    #[test]
    fn a_file_has_figures_apart_from_notes() {
        let row = Row { quantity: "mass, 3 km (paper's method: by hand)".into(), ..row() };
        let cells = csv_row(&row);
        let of = |name: &str| cells.iter().find(|it| it.0 == name).unwrap().1.as_str();
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
