//! `dynocar-bench scenarios`.

use std::path::PathBuf;

use clap::Args;
use dynocar_shared::PipelineKind;

use super::{rows, table};
use crate::output::{give, write_csv};

/// Resistance and mass in a user's day: how long an answer may be used, how soon, how often that
/// changes, and whether its intervals hold.
#[derive(Debug, Args)]
pub struct ScenariosArguments {
    /// Drives for each scenario
    #[arg(long, default_value_t = 20)]
    seeds: u64,
    /// The first seed
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// Hours of each drive
    #[arg(long, default_value_t = 2.0)]
    hours: f64,
    /// Only scenarios whose name contains this, as metro
    #[arg(long, value_name = "TEXT", default_value = "")]
    scenario: String,
    /// A pipeline; may be repeated
    #[arg(long = "pipeline", value_name = "KIND", default_value = "train_kalman")]
    pipelines: Vec<String>,
    /// Scenarios at a time
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the result as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

/// Runs the command; an error has its text and the exit status.
pub fn scenarios(arguments: &ScenariosArguments) -> Result<(), (String, u8)> {
    let mut chosen = rows::all();
    chosen.retain(|row| row.name.contains(&arguments.scenario));
    if chosen.is_empty() {
        let text = &arguments.scenario;
        return Err((format!("--scenario {text}: expected a part of a scenario's name"), 2));
    }
    let kinds: Result<Vec<PipelineKind>, _> = arguments
        .pipelines
        .iter()
        .map(|name| {
            let kind = PipelineKind::from_name(name);
            kind.ok_or_else(|| (format!("--pipeline {name}: expected a pipeline's kind"), 2))
        })
        .collect();
    if !(arguments.hours > 0.0 && arguments.hours.is_finite()) || arguments.seeds == 0 {
        return Err(("--hours and --seeds: expected more than 0".into(), 2));
    }
    let plan = table::Plan {
        scenarios: &chosen,
        kinds: &kinds?,
        seeds: arguments.seeds,
        first_seed: arguments.first_seed,
        hours: arguments.hours,
        threads: arguments.threads,
    };
    let lines = table::run(&plan).map_err(|error| (error.to_string(), 1))?;
    if let Some(file) = &arguments.csv {
        write_csv(file, &table::csv(&plan, &lines))?;
    }
    give(&arguments.json, &lines, || table::table(&lines))
}
