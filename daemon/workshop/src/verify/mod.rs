//! Repeated computation of every recorded snapshot from the recorded samples, with the recorded configuration or
//! another one, and with the code of the daemon's own pipelines.
//!
//! A pipeline is a function of its samples from the daemon's start on. A snapshot's `sequence` counts these samples,
//! and so shows whether the recording holds them all.

mod configurations;
mod pipelines;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use dynocar::config::{DaemonConfig, build_pipeline};
use dynocar_shared::schema::unit_of;
use dynocar_shared::{
    HALF_95, Parameter, ParameterSnapshot, Quantity, Reason, TrainId, TrainSample,
};

pub use configurations::{ConfigurationProblem, Configurations};
pub use pipelines::{ComparisonOutcome, SnapshotDifference, Verified, verify};

/// Fields of a snapshot that are stamps of the daemon's clock and are not computed from samples.
pub const STAMPS: [&str; 3] = ["epoch", "published_ns", "vouched_ns"];

/// Returns the answer for people.
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
        ComparisonOutcome::Same => String::new(),
        ComparisonOutcome::BeginsLate { before } => format!(
            "; cannot be verified: the pipeline had taken {before} samples before the first recorded"
        ),
        ComparisonOutcome::OtherSamples { agree_up_to: 0, why } => {
            format!("; cannot be verified: {why}")
        }
        ComparisonOutcome::OtherSamples { agree_up_to, why } => {
            format!("; cannot be verified after sample {agree_up_to}: {why}")
        }
        ComparisonOutcome::NotConfigured => {
            "; the attached configuration has no such pipeline".into()
        }
        ComparisonOutcome::Differs(it) => format!(
            "; differs from sample {} on: {} recorded as {}, computed as {}{state}",
            it.sample, it.field, it.recorded, it.computed
        ),
    }
}

/// The pipeline that answers for a quantity, and its snapshot after the last sample.
type Answer = (String, ParameterSnapshot);

/// Returns the answers of two configurations, the recorded one and another of this name, after the last of some
/// samples, side by side.
pub fn overlay(configs: [&DaemonConfig; 2], samples: &[TrainSample], name: &str) -> String {
    let answers = configs.map(|config| answers(config, samples));
    let mut text = format!(
        "after the last sample, each computed from the first recorded one\n{:<44} {:>32} {:>32}\n",
        "", "recorded configuration", name
    );
    let keys: BTreeSet<&(u64, Quantity)> = answers.iter().flat_map(BTreeMap::keys).collect();
    for key in keys {
        let both = answers.each_ref().map(|it| it.get(key));
        let mut row = |title: &str, show: &dyn Fn(&Answer) -> String| {
            let [one, two] = both.map(|it| it.map_or("-".to_owned(), show));
            let _ = writeln!(text, "{title:<44} {one:>32} {two:>32}");
        };
        row(&format!("train {}, {}", key.0, key.1), &|it| it.0.clone());
        row("  status", &|it| status(&it.1));
        for &parameter in Parameter::ALL {
            if both.into_iter().flatten().any(|it| it.1.index_of(parameter).is_some()) {
                let (name, unit) = (parameter.full_name(), unit_of(parameter.full_name()));
                let title = format!("  {name} in {unit}");
                let title = if unit.is_empty() { format!("  {name}") } else { title };
                row(&title, &|it| value(&it.1, parameter));
            }
        }
    }
    text + "± is the half width of the 95 % interval\n"
}

/// Returns the answers of a configuration for every quantity of every train after the last of some samples.
fn answers(config: &DaemonConfig, samples: &[TrainSample]) -> BTreeMap<(u64, Quantity), Answer> {
    let mut answered = BTreeMap::new();
    for train in &config.trains {
        let TrainId(id) = train.id;
        let own = || samples.iter().filter(|it| it.train_id == id);
        for &quantity in Quantity::ALL {
            let index = train.answers.pipeline_index(quantity).filter(|_| own().next().is_some());
            let Some(index) = index else { continue };
            let settings = &config.pipelines[index];
            let Ok(mut pipeline) = build_pipeline(settings, index as u32, train) else { continue };
            for sample in own() {
                pipeline.process(sample);
            }
            answered.insert((id, quantity), (settings.name.clone(), *pipeline.snapshot()));
        }
    }
    answered
}

fn status(it: &ParameterSnapshot) -> String {
    match it.reason() {
        None | Some(Reason::None) => it.status().to_string(),
        Some(reason) => format!("{} ({reason})", it.status()),
    }
}

fn value(it: &ParameterSnapshot, parameter: Parameter) -> String {
    match (it.value(parameter), it.std(parameter)) {
        (Some(value), Some(std)) => format!("{value:.6} ± {:.6}", HALF_95 * std),
        _ => "-".into(),
    }
}
