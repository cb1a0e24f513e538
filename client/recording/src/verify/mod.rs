//! Every recorded snapshot computed again, from the recorded samples by the recorded configuration,
//! with the code of the daemon's own pipelines.
//!
//! A pipeline is a function of its samples from the daemon's start on. A snapshot's `sequence` counts
//! them, so that it says whether the recording holds them all.

mod configurations;
mod overlay;
mod pipelines;

use std::fmt::Write;

pub use configurations::{ConfigurationProblem, Configurations};
pub use overlay::overlay;
pub use pipelines::{Difference, Outcome, Verified, verify};

/// Fields of a snapshot that are stamps of the daemon's clock and are not computed from samples.
pub const STAMPS: [&str; 3] = ["epoch", "published_ns", "vouched_ns"];

/// The answer for people.
pub fn text(verified: &[Verified]) -> String {
    let mut text = String::new();
    let mut epoch = None;
    for it in verified {
        if epoch != Some(it.epoch) {
            let _ = writeln!(text, "daemon of epoch {}", it.epoch);
            epoch = Some(it.epoch);
        }
        let Verified { train, index, name, recorded, same, .. } = it;
        let _ = writeln!(
            text,
            "  train {train}, {index} {name}: {same} of {recorded} snapshots the same to the bit{}",
            rest(it)
        );
    }
    let _ = writeln!(text, "compared: every field but {}", STAMPS.join(", "));
    text
}

fn rest(it: &Verified) -> String {
    let state = match it.keeps_state {
        true => "; the daemon keeps states ([state]) and may have started from one",
        false => "",
    };
    match &it.outcome {
        Outcome::Same => String::new(),
        Outcome::BeginsLate { before } => format!(
            "; cannot be verified: the pipeline had taken {before} samples before the first recorded"
        ),
        Outcome::OtherSamples { agree_up_to: 0, why } => format!("; cannot be verified: {why}"),
        Outcome::OtherSamples { agree_up_to, why } => {
            format!("; cannot be verified after sample {agree_up_to}: {why}")
        }
        Outcome::NotConfigured => "; the attached configuration has no such pipeline".into(),
        Outcome::Differs(it) => format!(
            "; differs from sample {} on: {} recorded as {}, computed as {}{state}",
            it.sample, it.field, it.recorded, it.computed
        ),
    }
}
