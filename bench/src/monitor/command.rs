//! `dynocar-bench monitor`.

use clap::Args;
use dynocar::output::report_line;
use dynocar_tests::simulator::{SimulatorSettings, simulate};

use super::matrix;
use super::watch::{Watched, watch};
use crate::explain::case::Case;
use crate::explain::family::FamilyArguments;
use crate::explain::scenario::Scenario;
use crate::output::{Failure, give};

/// The live monitor on every kind of undeclared effect, and on nulls: seconds of motion from onset
/// to the right suspect, hours with a wrong one, false suspicions in 100 hours.
#[derive(Debug, Args)]
pub struct MonitorArguments {
    #[command(flatten)]
    family: FamilyArguments,
    /// Runs of a quarter of an hour in each dataset
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u16).range(2..))]
    runs: u16,
}

impl MonitorArguments {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// When there is no such kind, or the result cannot be written.
    pub fn run(&self) -> Result<(), Failure> {
        let (family, runs) = (&self.family, usize::from(self.runs));
        let watched = family.over(&family.scenarios(Scenario::all())?, |case| {
            let watched = watch(&simulate(&SimulatorSettings { runs, ..case.settings() }));
            if family.verbose {
                print_case(case, &watched);
            }
            watched
        });
        let matrix = matrix::Matrix::of(&watched);
        give(&family.json, &matrix, || matrix::table(&matrix))
    }
}

/// One dataset's suspicions on standard error.
fn print_case(case: &Case, watched: &Watched) {
    let raised = watched.raised.iter().map(|(kind, s)| format!("{kind} at {s:.0} s"));
    let raised: Vec<String> = raised.collect();
    report_line(&format!(
        "{} seed {}: {} (wrong {:.0} s of {:.0})",
        case.scenario.name(),
        case.seed,
        if raised.is_empty() { "silent".into() } else { raised.join(", ") },
        watched.wrong_s,
        watched.driven_s
    ));
}
