//! The residual monitor over seeded simulations: the delay until it names an effect that begins to act, the time for
//! which it names one that does not act, and its false alarms.
//!
//! - [`fed_dataset`]: one simulated dataset, fed sample by sample

pub mod fed_dataset;

use std::collections::BTreeMap;

use clap::Args;
use dynocar::output::report_line;
use serde_json::json;

use self::fed_dataset::{Watched, watch};
use crate::explain::family::{FamilyArguments, SimulatedCase};
use crate::explain::scenario::ExplainScenario;
use crate::output::{BenchError, Record, counts, table};
use crate::statistics::median;

/// The live monitor on every kind of undeclared effect, and on nulls: seconds of motion from onset
/// to the right suspect, hours with a wrong one, false suspicions in 100 hours.
#[derive(Debug, Args)]
pub struct MonitorArguments {
    #[command(flatten)]
    family: FamilyArguments,
}

impl MonitorArguments {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// When there is no such kind, or the result cannot be written.
    pub fn run(&self) -> Result<(), BenchError> {
        let family = &self.family;
        let watched = family.over(&family.scenarios(ExplainScenario::all())?, |case| {
            let watched = watch(&case.simulate());
            if family.verbose {
                print_case(case, &watched);
            }
            watched
        });
        let kinds: Vec<Record> = watched.iter().map(|(kind, own)| record(*kind, own)).collect();
        let nulls = || watched.iter().filter(|(kind, _)| kind.is_null()).flat_map(|it| &it.1);
        let hours = nulls().map(|it| it.driven_s).sum::<f64>() / 3600.0;
        let suspicions: usize = nulls().map(|it| it.false_suspicions().count()).sum();
        let per_100_h = 100.0 * suspicions as f64 / hours.max(f64::MIN_POSITIVE);
        let all = json!({
            "kinds": kinds,
            "null_hours": hours,
            "null_suspicions": suspicions,
            "per_100_h": per_100_h,
        });
        family.output.give(&all, || {
            let words = format!(
                "nothing undeclared: {suspicions} suspicions in {hours:.0} h of motion, \
                 {per_100_h:.2} in 100 h\n"
            );
            table(&kinds) + &words
        })
    }
}

/// Returns the record of one kind; times are of motion. Datasets are those in which it acts, or all nulls, which
/// are right where the monitor stayed silent.
fn record(scenario: ExplainScenario, all: &[Watched]) -> Record {
    let is_null = scenario.is_null();
    let watched: Vec<&Watched> = all.iter().filter(|it| is_null || it.has_acted).collect();
    let count = |is_so: &dyn Fn(&Watched) -> bool| watched.iter().filter(|it| is_so(it)).count();
    let hours = |of: fn(&Watched) -> f64| watched.iter().map(|it| of(it)).sum::<f64>() / 3600.0;
    let mut after_s: Vec<f64> = watched.iter().filter_map(|it| it.named_after_s).collect();
    after_s.sort_unstable_by(f64::total_cmp);
    let mut others = BTreeMap::new();
    for kind in watched.iter().flat_map(|it| it.false_suspicions()) {
        *others.entry(kind.name()).or_insert(0) += 1;
    }
    let is_silent = |it: &Watched| it.raised.is_empty();
    let is_right = |it: &Watched| if is_null { is_silent(it) } else { it.named_after_s.is_some() };
    let nine_of_ten = after_s.get((after_s.len() * 9).div_ceil(10).max(1) - 1).copied();
    Record::default()
        .with("kind", scenario.name())
        .with("right", format!("{}/{}", count(&is_right), watched.len()))
        .with("wrong", count(&|it| !is_right(it) && !is_silent(it)))
        .with("missed", count(&|it| !is_right(it) && is_silent(it)))
        .number("after s", median(after_s), 0)
        .number("90 % s", nine_of_ten, 0)
        .number("hours", hours(|it| it.driven_s), 1)
        .number("wrong h", hours(|it| it.wrong_s), 2)
        .with("others that led", counts(&others))
}

/// One dataset's suspicions on standard error.
fn print_case(case: &SimulatedCase, watched: &Watched) {
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
