//! Speed of every estimator compared with peers in the same run.
//!
//! Peers do the same work on the same data and must give the same answer before anything is
//! timed, so that no speed is bought with accuracy.
//!
//! - [`measure`]: interleaved rounds, medians, ratios
//! - [`textbook`], [`em_peers`]: what our estimators are compared with
//! - [`least_squares`], [`trajectory_bank`], [`trajectory_fit`], [`braking`], [`mass`],
//!   [`resistance`]: the cases
//! - [`pipelines`]: every kind of pipeline from sample to snapshot
//! - [`report`]: the table and the JSON
//! - [`against`]: another build of the program beside this one

pub mod against;
pub mod braking;
pub mod em_peers;
pub mod least_squares;
pub mod mass;
pub mod measure;
pub mod pipelines;
pub mod report;
pub mod resistance;
pub mod textbook;
pub mod trajectory_bank;
pub mod trajectory_fit;

use dynocar_analysis::dataset::DatasetError;

use measure::Case;
use pipelines::DemoRun;

/// Every case, in the order of the table.
///
/// # Errors
///
/// When the demonstration dataset is wrong.
pub fn cases() -> Result<Vec<Case>, DatasetError> {
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
