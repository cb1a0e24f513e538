//! Accuracy over seeded runs: the papers' figures, their methods and ours compared with the bound.

mod bound;
pub mod braking;
mod braking_score;
mod braking_table;
mod jin;
#[cfg(test)]
mod literal_em_tests;
mod liu;
mod promise;
mod row;
mod score;
mod wang;
mod xia;
mod xie;

use std::path::PathBuf;

use clap::Args;
use dynocar::output::report_line;
use serde_json::json;

use crate::ending::until_due;
use crate::output::{BenchError, OutputArguments, Record, expect_none, named, table, write_csv};
use promise::PromiseVerdict;
use row::{PaperRow, Seeds};

/// Every table of the five papers over seeded runs: the paper's figure, its method, ours, the bound.
///
/// Exit status 1 when a row breaks one of its promises.
#[derive(Debug, Args)]
pub struct PapersArguments {
    /// Few seeds: a check that everything runs, not a measurement
    #[arg(long)]
    quick: bool,
    /// Seeded runs behind each row
    #[arg(long, default_value_t = 200, conflicts_with = "quick")]
    seeds: usize,
    /// The first seed; another one shows whether the figures hold on runs never seen before
    #[arg(long, default_value_t = 0)]
    first_seed: u64,
    /// Only this paper, as xia
    #[arg(long, value_name = "NAME")]
    paper: Option<String>,
    #[command(flatten)]
    output: OutputArguments,
    /// Write the rows as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

/// Function that measures the rows of a paper.
type Measure = fn(Seeds) -> Vec<PaperRow>;

/// Every paper, by year.
const SOURCES: [(&str, Measure); 5] = [
    ("xia", xia::rows),
    ("liu", liu::rows),
    ("xie", xie::rows),
    ("jin", jin::rows),
    ("wang", wang::rows),
];

impl PapersArguments {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// When there is no such paper, a result cannot be written, or a row breaks a promise.
    pub fn run(&self) -> Result<(), BenchError> {
        let seeds =
            Seeds { first: self.first_seed, count: if self.quick { 8 } else { self.seeds } };
        let chosen: Vec<(&str, Measure)> = match &self.paper {
            Some(name) => vec![(name, named("--paper", name, &SOURCES)?)],
            None => SOURCES.to_vec(),
        };
        let mut rows = Vec::new();
        for (name, measure) in until_due(chosen) {
            report_line(&format!("{name}: {} seeds from {}", seeds.count, seeds.first));
            rows.extend(measure(seeds));
        }
        let verdicts: Vec<PromiseVerdict> = rows.iter().map(PromiseVerdict::from_row).collect();
        let judged = || rows.iter().zip(&verdicts);
        let records: Vec<Record> = judged().map(|(row, verdict)| record(row, verdict)).collect();
        let promised: usize = verdicts.iter().map(|it| it.promised.len()).sum();
        let broken: usize = verdicts.iter().map(|it| it.broken.len()).sum();
        self.output.give(&json!({ "rows": records, "promised": promised }), || {
            table(&records) + &format!("promises: {promised}, {broken} broken\n")
        })?;
        if let Some(file) = &self.csv {
            write_csv(file, &records)?;
        }
        let words = judged()
            .filter(|(_, it)| !it.broken.is_empty())
            .map(|(row, it)| format!("{}, {}: {}", row.paper, row.quantity, it.broken.join(", ")));
        expect_none("broken promises", words.collect())
    }
}

/// Returns a row for people and for a file of CSV.
fn record(row: &PaperRow, verdict: &PromiseVerdict) -> Record {
    let mut notes: Vec<String> =
        Some(row.note.clone()).filter(|it| !it.is_empty()).into_iter().collect();
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
        .with("quantity", &row.quantity)
        .with("unit", row.unit)
        .shown("published", figure(row.published), row.published)
        .shown("papers_method", figure(row.paper_method), row.paper_method)
        .shown("baseline", figure(row.baseline), row.baseline)
        .shown("ours", figure(row.ours), row.ours)
        .shown("bound", figure(row.bound), row.bound)
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

    fn row() -> PaperRow {
        PaperRow {
            published: Some(0.04),
            ours: Some(0.0297),
            bound: Some(0.027),
            coverage: Some(0.951),
            ..PaperRow::new(
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
        let row =
            PaperRow { quantity: "mass, 3 km".into(), ..row() }.noted("paper's method: by hand");
        let record = record(&row, &PromiseVerdict::from_row(&row));
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
