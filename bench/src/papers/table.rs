//! The comparison as text.

use std::fmt::Write;

use super::{Row, Verdict};

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
        for (place, (cell, width)) in line.iter().zip(widths).enumerate() {
            // Writing into a String cannot fail.
            let _ = match place {
                0..4 => write!(text, "{cell:<width$}  "),
                _ => write!(text, "{cell:>width$}  "),
            };
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    }
    text
}

/// What stands above the tables of the page.
const INTRODUCTION: &str = "\
# The papers' tables, measured

Made by `cargo run --release -p dynocar-bench -- papers --markdown docs/papers.md`: errors over seeded runs.

| column | meaning |
| --- | --- |
| paper's method, baseline | the corrected formulas on the same data as ours |
| bound | Cramér–Rao or posterior Cramér–Rao bound, computed in the same run |
| coverage | share of our 95 % intervals that hold the truth |
| NEES | 1 when the covariance is right; the band holds it in 99 % of such measurements. Where all runs share one curve (Xie 2019, Jin 2020, except *drawn coefficients*) it is as wide as one draw leaves it |

Rows that break what the project promises say `BROKEN` and what.

Deviations from the papers:

- Liu: segments end where a noisy speed first reaches a bound, which biases w0 by -1.7 %. V-MILS prints no rule for bad data; the gate here acts on rows that a
  spike has already spoilt. The size of outliers is assumed (1 to 5 km/h).
- Xia: windows of 2 km settle late to 0.1 N/kN, since Newton's method seldom reaches the printed tolerance within 100 iterations where the Hessian is not positive definite;
  to 0.2 N/kN they settle within 1 to 2 km.
";

/// A page of the documentation: one table for each paper, and below it the notes that several rows share.
pub fn for_documentation(rows: &[Row]) -> String {
    let mut text = INTRODUCTION.to_owned();
    for of_paper in rows.chunk_by(|one, other| one.paper == other.paper) {
        let mut notes = Vec::new();
        let _ = writeln!(text, "\n## {}\n", of_paper[0].paper);
        let _ = writeln!(text, "| {} | seeds |", HEADINGS[1..12].join(" | "));
        let _ = writeln!(text, "|{}", " --- |".repeat(HEADINGS.len() - 1));
        for row in of_paper {
            let mut cells = cells(row);
            for (from, into, start) in [(2, 2, " (paper's method: "), (12, 11, "; may be wider: ")]
            {
                if let Some((cell, note)) = cells[from].clone().split_once(start) {
                    let note = format!("{}{note}", start.trim_start_matches([' ', '(', ';']));
                    let cell = if from == into { cell } else { cells[into].as_str() };
                    cells[into] = format!("{cell} ({})", number_of(&note, &mut notes));
                }
            }
            if cells[12].starts_with("BROKEN") {
                cells[11] = format!("{} {}", cells[11], cells[12]);
            }
            let _ = writeln!(text, "| {} | {} |", cells[1..12].join(" | "), row.seeds);
        }
        for (place, note) in notes.iter().enumerate() {
            let _ = write!(text, "{}({}) {note}.", if place == 0 { "\n" } else { " " }, place + 1);
        }
        text += if notes.is_empty() { "" } else { "\n" };
    }
    text
}

/// A note's number, from 1.
fn number_of(note: &str, notes: &mut Vec<String>) -> usize {
    let note = note.trim_end_matches(')').to_owned();
    let place = notes.iter().position(|it| *it == note).unwrap_or_else(|| {
        notes.push(note);
        notes.len() - 1
    });
    place + 1
}

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
    fn a_page_has_one_table_for_each_paper() {
        let text = for_documentation(&[row(), row()]);
        assert_eq!(text.matches("## Xia 2023").count(), 1);
        assert_eq!(text.matches("| Table 3 |").count(), 2);
    }

    #[test]
    fn what_several_rows_say_of_a_method_stands_once_below_their_table() {
        let with_note = Row { quantity: "mass (paper's method: by hand)".into(), ..row() };
        let text = for_documentation(&[with_note.clone(), with_note]);
        assert_eq!(text.matches("| mass (1) |").count(), 2);
        assert!(text.ends_with("\n(1) paper's method: by hand.\n"), "{text}");
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
