//! `dynocar explain` over seeded simulations of every kind of effect and of nulls.
//!
//! - [`scenario`]: the simulated effects and the usual errors
//! - [`family`]: the simulated datasets of a scenario
//! - [`grade`]: the answer against the truth
//! - [`attainable`]: the error of the true law with estimated numbers
//! - [`parameters`]: numbers and places of an answer against the true ones
//! - [`matrix`]: all kinds over all seeds, in numbers
//! - [`growth`]: time for 1, 4 and 16 times the data

pub mod attainable;
pub mod family;
pub mod grade;
pub mod growth;
pub mod matrix;
pub mod parameters;
pub mod scenario;

use std::path::PathBuf;

use clap::Args;
use dynocar::output::report_line;
use dynocar_shared::vocabulary::EffectKind;

use self::family::{FamilyArguments, SimulatedCase, explained, read};
use self::grade::{Grade, grade};
use self::scenario::ExplainScenario;
use crate::output::{BenchError, during, table};

/// Every kind of undeclared effect, and nulls, over simulated datasets: power, false alarms,
/// confusions, localisation, parameters and their coverage.
#[derive(Debug, Args)]
pub struct ExplainBenchArguments {
    #[command(flatten)]
    family: FamilyArguments,
    /// Instead of the matrix, the time for 1, 4 and 16 times the data: one dataset of each kind
    /// (none, tunnel_drag, dragging_brake and wind unless chosen) with more runs, then longer ones
    #[arg(long, conflicts_with_all = ["seeds", "threads", "write", "verbose", "world"])]
    growth: bool,
    /// Write the simulated datasets with their truth into this folder
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
}

impl ExplainBenchArguments {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// When there is no such kind, or a file cannot be written.
    pub fn run(&self) -> Result<(), BenchError> {
        let family = &self.family;
        if self.growth {
            use EffectKind::{DraggingBrake, None, TunnelDrag, Wind};
            let few = [None, TunnelDrag, DraggingBrake, Wind].map(ExplainScenario::Kind).to_vec();
            let sizes = growth::measure(&family.scenarios(few)?, family.first_seed);
            return family.output.give(&sizes, || table(&sizes));
        }
        let scenarios = family.scenarios(ExplainScenario::all())?;
        if let Some(folder) = &self.write {
            for case in family.cases(&scenarios) {
                case.write(folder).map_err(during(folder.display()))?;
            }
        }
        let grades = family.over(&scenarios, |case| {
            let simulated = case.simulate();
            let graded = grade(&simulated, case, &explained(&read(&simulated)));
            if family.verbose {
                print_case(case, &graded);
            }
            graded
        });
        let (all, words) = matrix::summary(&grades);
        family.output.give(&all, || words)
    }
}

/// One dataset's outcome on standard error.
fn print_case(case: &SimulatedCase, grade: &Grade) {
    let kinds: Vec<_> = case.scenario.kinds(case.seed).iter().map(|kind| kind.name()).collect();
    let parameters: Vec<String> = grade
        .parameters
        .iter()
        .map(|p| format!("{} {:+.3} ({:+.1} sd)", p.name, p.error, p.z))
        .collect();
    report_line(&format!(
        "{} seed {}: {} {} {} iou {:?} ends {}/{} share {:?} {}",
        if grade.is_right { "right" } else { "WRONG" },
        case.seed,
        kinds.join("+"),
        grade.verdict,
        grade.named.join("+"),
        grade.iou,
        grade.ends_held.iter().filter(|held| **held).count(),
        grade.ends_held.len(),
        grade.attained.and_then(|it| it.share),
        parameters.join(", ")
    ));
    report_line(&format!("    acceptance score {:.2}", grade.acceptance_score));
    for detail in &grade.details {
        report_line(&format!("    {detail}"));
    }
}
