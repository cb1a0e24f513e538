//! `dynocar-bench explain`.

use std::path::PathBuf;

use clap::Args;

use super::case::Case;
use super::grade::Grade;
use super::scenario::Scenario;
use super::world::World;
use super::{growth, matrix};
use crate::output::give;
use dynocar_shared::vocabulary::EffectKind;

/// Every kind of undeclared effect, and nulls, over simulated datasets: power, false alarms,
/// confusions, localisation, parameters and their coverage.
#[derive(Debug, Args)]
pub struct ExplainArguments {
    /// Simulated datasets for each kind
    #[arg(long, default_value_t = 20)]
    seeds: usize,
    /// The first seed
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// Only this kind, as tunnel_drag, or none, two_effects, poor_recording; may be repeated
    #[arg(long = "kind", value_name = "NAME")]
    kinds: Vec<String>,
    /// What is a little wrong besides the effect
    #[arg(long, value_enum, default_value_t = World::Plain)]
    world: World,
    /// Datasets at a time
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Instead of the matrix, the time for 1, 4 and 16 times the data: one dataset of each kind
    /// (none, tunnel_drag, dragging_brake and wind unless chosen) with more runs, then longer ones
    #[arg(long, conflicts_with_all = ["seeds", "threads", "write", "verbose", "world"])]
    growth: bool,
    /// Print the outcome of every dataset on standard error
    #[arg(long)]
    verbose: bool,
    /// Write the simulated datasets with their truth into this folder
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl ExplainArguments {
    fn scenarios(&self) -> Result<Vec<Scenario>, (String, u8)> {
        let all = || {
            use EffectKind::{DraggingBrake, None, TunnelDrag, Wind};
            let few = [None, TunnelDrag, DraggingBrake, Wind].map(Scenario::Kind);
            if self.growth { few.to_vec() } else { Scenario::all() }
        };
        Ok(Scenario::named(&self.kinds)?.unwrap_or_else(all))
    }
}

/// Runs the command; an error has its text and the exit status.
pub fn explain(arguments: &ExplainArguments) -> Result<(), (String, u8)> {
    let scenarios = arguments.scenarios()?;
    let (seeds, first) = (arguments.seeds, arguments.first_seed);
    if arguments.growth {
        let sizes = growth::measure(&scenarios, first, &|size| {
            dynocar::output::report_line(&format!(
                "{} x{}: {:.1} s",
                size.axis.name(),
                size.factor,
                size.seconds
            ));
        });
        return give(&arguments.json, &sizes, || growth::table(&sizes));
    }
    let cases = matrix::cases(&scenarios, seeds, first, arguments.world);
    if let Some(folder) = &arguments.write {
        for case in &cases {
            case.write(folder).map_err(|error| (format!("{}: {error}", folder.display()), 1))?;
        }
    }
    let report = |case: &Case, grade: &Grade| {
        if arguments.verbose {
            print_case(case, grade);
        }
    };
    let matrix = matrix::run(&scenarios, &cases, arguments.threads.max(1), &report);
    give(&arguments.json, &matrix, || matrix::table(&matrix))
}

/// One dataset's outcome on standard error.
fn print_case(case: &Case, grade: &Grade) {
    let kinds: Vec<_> = case.scenario.kinds(case.seed).iter().map(|kind| kind.name()).collect();
    let parameters: Vec<String> = grade
        .parameters
        .iter()
        .map(|p| format!("{} {:+.3} ({:+.1} sd)", p.name, p.error, p.z))
        .collect();
    dynocar::output::report_line(&format!(
        "{} seed {}: {} {} {} iou {:?} ends {}/{} share {:?} {}",
        if grade.is_right { "right" } else { "WRONG" },
        case.seed,
        kinds.join("+"),
        grade.verdict,
        grade.named.join("+"),
        grade.iou,
        grade.ends_held.iter().filter(|held| **held).count(),
        grade.ends_held.len(),
        grade.share,
        parameters.join(", ")
    ));
    dynocar::output::report_line(&format!("    acceptance score {:.2}", grade.acceptance_score));
    for detail in &grade.details {
        dynocar::output::report_line(&format!("    {detail}"));
    }
}
