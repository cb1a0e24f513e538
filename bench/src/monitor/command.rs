//! `dynocar-bench monitor`.

use std::path::PathBuf;

use clap::Args;

use super::matrix;
use crate::explain::scenario::Scenario;
use crate::explain::world::World;
use crate::output::give;

/// The live monitor on every kind of undeclared effect, and on nulls: seconds of motion from onset
/// to the right suspect, hours with a wrong one, false suspicions in 100 hours.
#[derive(Debug, Args)]
pub struct MonitorArguments {
    /// Simulated datasets for each kind
    #[arg(long, default_value_t = 20)]
    seeds: usize,
    /// The first seed
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// What is a little wrong besides the effect
    #[arg(long, value_enum, default_value_t = World::Plain)]
    world: World,
    /// Runs of a quarter of an hour in each dataset
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u16).range(2..))]
    runs: u16,
    /// Only this kind, as tunnel_drag, or none, none_poor_recording; may be repeated
    #[arg(long = "kind", value_name = "NAME")]
    kinds: Vec<String>,
    /// Datasets at a time
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Print every suspicion of every dataset on standard error
    #[arg(long)]
    verbose: bool,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Runs the command; an error has its text and the exit status.
pub fn monitor(arguments: &MonitorArguments) -> Result<(), (String, u8)> {
    let scenarios = Scenario::named(&arguments.kinds)?.unwrap_or_else(Scenario::all);
    let matrix = matrix::run(
        &matrix::Plan {
            scenarios: &scenarios,
            seeds: arguments.seeds,
            first_seed: arguments.first_seed,
            world: arguments.world,
            runs: usize::from(arguments.runs),
            threads: arguments.threads,
        },
        &|case, watched| {
            if arguments.verbose {
                let raised = watched.raised.iter().map(|(kind, s)| format!("{kind} at {s:.0} s"));
                let raised: Vec<String> = raised.collect();
                dynocar::output::report_line(&format!(
                    "{} seed {}: {} (wrong {:.0} s of {:.0})",
                    case.scenario.name(),
                    case.seed,
                    if raised.is_empty() { "silent".into() } else { raised.join(", ") },
                    watched.wrong_s,
                    watched.driven_s
                ));
            }
        },
    );
    give(&arguments.json, &matrix, || matrix::table(&matrix))
}
