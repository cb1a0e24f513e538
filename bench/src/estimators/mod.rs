//! Speed of every estimator compared with peers in the same run.
//!
//! Peers do the same work on the same data and must give the same answer before anything is
//! timed, so that no speed is bought with accuracy.
//!
//! - [`measure`]: interleaved rounds, medians, ratios, the table
//! - [`textbook`], [`em_peers`]: what our estimators are compared with
//! - [`least_squares`], [`trajectory_bank`], [`trajectory_fit`], [`braking`], [`mass`],
//!   [`resistance`]: the cases
//! - [`pipelines`]: every kind of pipeline from sample to snapshot
//! - [`against`]: another build of the program beside this one

pub mod against;
pub mod braking;
pub mod em_peers;
pub mod least_squares;
pub mod mass;
pub mod measure;
pub mod pipelines;
pub mod resistance;
pub mod textbook;
pub mod trajectory_bank;
pub mod trajectory_fit;

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use crate::output::{Failure, Record, Usage, give, table};
use measure::{Case, Effort};
use pipelines::DemoRun;

/// Speed of every estimator compared with peers that do the same work on the same data.
#[derive(Debug, Args)]
pub struct EstimatorsArguments {
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

impl EstimatorsArguments {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// When there is no such case, a peer disagrees, or the other build does not measure.
    pub fn run(&self) -> Result<(), Failure> {
        if let (Some(other), Some(case)) = (&self.beside, &self.case) {
            let cases = against::measure(other, case)?;
            return give(&self.json, &cases, || table(&cases));
        }
        let effort = if self.quick { Effort::QUICK } else { Effort::FULL };
        let mut chosen = cases()?;
        if let Some(text) = &self.case {
            chosen.retain(|case| case.name.contains(text));
            if chosen.is_empty() {
                let words = format!("--case {text}: expected a part of a case's name");
                return Err(Usage(words).into());
            }
        }
        let mut records: Vec<Record> = Vec::new();
        for case in chosen {
            records.extend(case.measure(&effort)?);
        }
        give(&self.json, &json!({ "cases": records }), || table(&records))
    }
}

/// Every case, in the order of the table.
///
/// # Errors
///
/// When the demonstration dataset is wrong.
pub fn cases() -> Result<Vec<Case>, Failure> {
    let run = DemoRun::read()?;
    let mut cases = least_squares::cases();
    cases.extend(trajectory_bank::cases());
    cases.extend(trajectory_fit::cases());
    cases.extend(braking::cases());
    cases.extend(mass::cases(&run.train));
    cases.extend(resistance::cases());
    cases.extend(pipelines::cases(&run));
    Ok(cases)
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_peer_gives_our_answer() {
        for mut case in super::cases().unwrap() {
            case.check().unwrap();
        }
    }
}
