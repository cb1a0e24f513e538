//! Accuracy over seeded runs: the papers' figures, their methods and ours compared with the bound.

mod bound;
mod braking;
mod braking_run;
mod braking_score;
mod braking_table;
mod differences;
mod jin;
mod literal_em;
mod liu;
mod promise;
mod row;
mod score;
mod seeds;
mod table;
mod wang;
mod xia;
mod xie;

use std::path::PathBuf;

use clap::Args;
use dynocar::output::report_line;
use serde::Serialize;

use crate::output::{self, Failure, expect, give, write_csv};
use promise::Verdict;
use row::Row;
use seeds::Seeds;

/// Every table of the five papers over seeded runs: the paper's figure, its method, ours, the bound.
///
/// Exit status 1 when a row breaks what is promised of it.
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
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the rows as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

#[derive(Serialize)]
struct Answer {
    rows: Vec<JudgedRow>,
}

/// A row with what is promised of it.
#[derive(Serialize)]
struct JudgedRow {
    #[serde(flatten)]
    row: Row,
    #[serde(flatten)]
    verdict: Verdict,
}

/// What measures the rows of a paper.
type Measure = fn(Seeds) -> Vec<Row>;

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
    pub fn run(&self) -> Result<(), Failure> {
        let seeds =
            Seeds { first: self.first_seed, count: if self.quick { 8 } else { self.seeds } };
        let is_chosen = |name: &str| self.paper.as_ref().is_none_or(|paper| paper == name);
        expect(SOURCES.iter().any(|(name, _)| is_chosen(name)), || {
            format!("--paper: expected one of {}", SOURCES.map(|(name, _)| name).join(", "))
        })?;
        let mut rows = Vec::new();
        for (name, measure) in SOURCES.into_iter().filter(|(name, _)| is_chosen(name)) {
            report_line(&format!("{name}: {} seeds from {}", seeds.count, seeds.first));
            rows.extend(measure(seeds));
        }
        let judge = |row: Row| JudgedRow { verdict: Verdict::of(&row), row };
        let answer = Answer { rows: rows.into_iter().map(judge).collect() };
        let records: Vec<_> =
            answer.rows.iter().map(|it| table::record(&it.row, &it.verdict)).collect();
        let promised = || answer.rows.iter().map(|it| it.verdict.promised.len()).sum::<usize>();
        let broken = || answer.rows.iter().map(|it| it.verdict.broken.len()).sum::<usize>();
        give(&self.json, &answer, || {
            let counts = format!("promises: {}, {} broken\n", promised(), broken());
            output::table(&records) + &counts
        })?;
        if let Some(file) = &self.csv {
            write_csv(file, &records)?;
        }
        let broken = answer.rows.iter().filter(|it| !it.verdict.broken.is_empty());
        let words = broken.map(|JudgedRow { row, verdict }| {
            format!("{}, {}: {}", row.paper, row.quantity, verdict.broken.join(", "))
        });
        let words: Vec<String> = words.collect();
        match words.is_empty() {
            true => Ok(()),
            false => Err(format!("broken promises:\n{}", words.join("\n")).into()),
        }
    }
}
