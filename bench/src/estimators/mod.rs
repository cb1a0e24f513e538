//! Time of an update of every estimator and every pipeline.
//!
//! - [`measure`]: rounds, medians, the table
//! - [`least_squares`], [`trajectory`], [`braking`]: parts of estimators
//! - [`pipelines`]: every kind of pipeline from sample to snapshot, and the filter of the mass
//! - [`against`]: another build of the program compared with this one

pub mod against;
pub mod braking;
pub mod least_squares;
pub mod measure;
pub mod pipelines;
pub mod trajectory;

use std::path::PathBuf;

use clap::Args;
use dynocar_analysis::dataset::DatasetError;
use serde_json::json;

use crate::ending::until_due;
use crate::output::{BenchError, OutputArguments, Record, containing, table};
use measure::{Effort, EstimatorCase};

/// Time of an update of every estimator and every pipeline.
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
    #[command(flatten)]
    output: OutputArguments,
}

impl EstimatorsArguments {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// When there is no such case, or the other build does not measure.
    pub fn run(&self) -> Result<(), BenchError> {
        let text = self.case.as_deref().unwrap_or_default();
        if let Some(other) = &self.beside {
            let cases = against::measure(other, text)?;
            return self.output.give(&cases, || table(&cases));
        }
        let effort = if self.quick { Effort::QUICK } else { Effort::FULL };
        let chosen = containing("--case", text, cases()?, |case| case.name.clone())?;
        let records: Vec<Record> = until_due(chosen).map(|it| it.measure(&effort)).collect();
        self.output.give(&json!({ "cases": records }), || table(&records))
    }
}

/// Returns every case, in the order of the table.
///
/// # Errors
///
/// When the demonstration dataset is wrong.
fn cases() -> Result<Vec<EstimatorCase>, DatasetError> {
    let mut cases = least_squares::cases();
    cases.extend(trajectory::cases());
    cases.extend(braking::cases());
    cases.extend(pipelines::cases()?);
    Ok(cases)
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_case_runs_and_has_a_name_of_its_own() {
        let mut cases = super::cases().unwrap();
        let mut names: Vec<String> = cases.iter().map(|case| case.name.clone()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), cases.len());
        assert!(cases.iter_mut().all(|case| !case.time(1).is_zero()));
    }
}
