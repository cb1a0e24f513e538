//! The commands of `dynocar-bench`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, CommandFactory, Parser, Subcommand};
use dynocar::cli::parse;
use dynocar::output::report_line;
use serde::Serialize;

use crate::drive::command::{DriveArguments, drive};
use crate::estimators::measure::Effort;
use crate::estimators::{self, against, report};
use crate::explain::command::{ExplainArguments, explain};
use crate::latency::server::{PeerArguments, serve};
use crate::latency::{self, LatencyArguments, plot};
use crate::load::{self, LoadArguments};
use crate::monitor::command::{MonitorArguments, monitor};
use crate::output::{give, write_csv};
use crate::papers::{self, Row, Seeds, Verdict, table};
use crate::scenarios::command::{ScenariosArguments, scenarios};
use crate::survey::{self, SurveyArguments};

/// Measures Dynocar: accuracy against the statistical bound, speed against peers.
#[derive(Debug, Parser)]
#[command(name = "dynocar-bench", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Drive(DriveArguments),
    Estimators(EstimatorsArguments),
    Explain(ExplainArguments),
    Latency(LatencyArguments),
    Load(LoadArguments),
    Monitor(MonitorArguments),
    Papers(PapersArguments),
    Scenarios(ScenariosArguments),
    Survey(SurveyArguments),
    #[command(hide = true)]
    Peer(PeerArguments),
}

/// Speed of every estimator compared with peers that do the same work on the same data.
#[derive(Debug, Args)]
struct EstimatorsArguments {
    /// Few rounds: a check that everything runs, not a measurement
    #[arg(long)]
    quick: bool,
    /// Only the cases whose name contains this, as rls
    #[arg(long, value_name = "TEXT")]
    case: Option<String>,
    /// Another build of this program, measured by turns with this one
    #[arg(long, value_name = "PROGRAM", requires = "case", conflicts_with = "quick")]
    beside: Option<PathBuf>,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Every table of the five papers over seeded runs: the paper's figure, its method, ours, the bound.
///
/// Exit status 1 when a row breaks what is promised of it.
#[derive(Debug, Args)]
struct PapersArguments {
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
struct PapersAnswer<'a> {
    rows: Vec<JudgedRow<'a>>,
}

/// A row with what is promised of it.
#[derive(Serialize)]
struct JudgedRow<'a> {
    #[serde(flatten)]
    row: &'a Row,
    #[serde(flatten)]
    verdict: Verdict,
}

/// Seeded runs of a quick check.
const QUICK_SEEDS: usize = 8;

/// The command line of `dynocar-bench`.
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Parses the command line, runs the command, reports a failure on standard error.
pub fn main() -> ExitCode {
    let arguments = match parse::<Arguments>("dynocar-bench") {
        Ok(arguments) => arguments,
        Err(status) => return status,
    };
    let result = match &arguments.command {
        Command::Drive(arguments) => drive(arguments),
        Command::Estimators(arguments) => estimators(arguments),
        Command::Explain(arguments) => explain(arguments),
        Command::Latency(arguments) => latency(arguments),
        Command::Load(arguments) => load(arguments),
        Command::Monitor(arguments) => monitor(arguments),
        Command::Papers(arguments) => papers(arguments),
        Command::Scenarios(arguments) => scenarios(arguments),
        Command::Survey(arguments) => survey::run(arguments),
        Command::Peer(arguments) => serve(arguments).map_err(|error| (error.to_string(), 1)),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err((message, status)) => {
            report_line(&format!("dynocar-bench: {message}"));
            ExitCode::from(status)
        }
    }
}

fn estimators(arguments: &EstimatorsArguments) -> Result<(), (String, u8)> {
    if let (Some(other), Some(case)) = (&arguments.beside, &arguments.case) {
        let cases = against::measure(other, case).map_err(|error| (error.to_string(), 1))?;
        return give(&arguments.json, &cases, || against::table(&cases));
    }
    let effort = if arguments.quick { Effort::QUICK } else { Effort::FULL };
    let mut cases = estimators::cases().map_err(|error| (error.to_string(), 1))?;
    if let Some(text) = &arguments.case {
        cases.retain(|case| case.name.contains(text));
        if cases.is_empty() {
            return Err((format!("--case {text}: expected a part of a case's name"), 2));
        }
    }
    let mut times = Vec::with_capacity(cases.len());
    for case in cases {
        times.push(case.measure(&effort).map_err(|error| (error.to_string(), 1))?);
    }
    give(&arguments.json, &report::Report::of(&times), || report::table(&times))
}

fn papers(arguments: &PapersArguments) -> Result<(), (String, u8)> {
    let count = if arguments.quick { QUICK_SEEDS } else { arguments.seeds };
    let seeds = Seeds { first: arguments.first_seed, count };
    let sources = papers::sources();
    let chosen: Vec<_> = sources
        .iter()
        .filter(|source| arguments.paper.as_ref().is_none_or(|name| name == source.name))
        .collect();
    if chosen.is_empty() {
        let names: Vec<_> = sources.iter().map(|source| source.name).collect();
        return Err((format!("--paper: expected one of {}", names.join(", ")), 2));
    }
    let mut rows = Vec::new();
    for source in chosen {
        report_line(&format!("{}: {} seeds from {}", source.name, seeds.count, seeds.first));
        rows.extend((source.rows)(seeds));
    }
    let judged =
        rows.iter().map(|row| JudgedRow { row, verdict: Verdict::of(row) }).collect::<Vec<_>>();
    let broken: Vec<String> = judged
        .iter()
        .filter(|judged| !judged.verdict.broken.is_empty())
        .map(|JudgedRow { row, verdict }| {
            format!("{}, {}: {}", row.paper, row.quantity, verdict.broken.join(", "))
        })
        .collect();
    give(&arguments.json, &PapersAnswer { rows: judged }, || table::for_terminal(&rows))?;
    if let Some(file) = &arguments.csv {
        write_csv(file, &table::csv(&rows))?;
    }
    match broken.is_empty() {
        true => Ok(()),
        false => Err((format!("broken promises:\n{}", broken.join("\n")), 1)),
    }
}

fn latency(arguments: &LatencyArguments) -> Result<(), (String, u8)> {
    let measured = latency::run(arguments).map_err(|error| {
        let status = if matches!(error, latency::LatencyError::Arguments(_)) { 2 } else { 1 };
        (error.to_string(), status)
    })?;
    if let Some(file) = &arguments.plot {
        plot::draw(&measured, file).map_err(|error| (error.to_string(), 1))?;
    }
    let report = latency::report::Report::of(&measured);
    give(&arguments.json, &report, || latency::report::table(&report))
}

fn load(arguments: &LoadArguments) -> Result<(), (String, u8)> {
    let report = load::run(arguments).map_err(|error| {
        let status = if matches!(error, load::LoadError::Arguments(_)) { 2 } else { 1 };
        (error.to_string(), status)
    })?;
    give(&arguments.json, &report, || load::report::table(&report))
}
