//! `dynocar replay --verify`: repeated computation of every recorded snapshot from the recorded samples, with the
//! recorded configuration or another one, and with the code of the daemon's own pipelines.
//!
//! A pipeline is a function of its samples from the daemon's start on. A snapshot's `sequence` counts these samples,
//! and so shows whether the recording holds them all.

mod pipelines;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use dynocar::cli::Failure;
use dynocar::config::{ConfigError, DaemonConfig, build_pipeline};
use dynocar::output::{print, report_line};
use dynocar_mcap::recording::Recording;
use dynocar_mcap::writing::{CONFIGURATION, folder_of_configuration};
use dynocar_shared::schema::unit_of;
use dynocar_shared::{
    HALF_95, Parameter, ParameterSnapshot, Quantity, Reason, TrainId, TrainSample,
};
use toml::{Table, Value};

use crate::formats;

pub use pipelines::{ComparisonOutcome, SnapshotDifference, Verified, verify};

/// Fields of a snapshot that are stamps of the daemon's clock and are not computed from samples.
pub const STAMPS: [&str; 3] = ["epoch", "published_ns", "vouched_ns"];

/// Compute every recorded snapshot again.
#[derive(Debug, Args)]
pub struct VerifyArguments {
    /// The recording; of one that rotated, its files in order
    #[arg(required = true)]
    recording: Vec<PathBuf>,
    /// Also print the estimates that this configuration of the daemon would have given
    #[arg(long, value_name = "FILE")]
    with: Option<PathBuf>,
}

/// Computes every snapshot of a recording again, and reports the comparison.
///
/// # Errors
///
/// When the recording holds no snapshots or no configuration, or a computed snapshot differs.
pub fn execute(arguments: &VerifyArguments) -> Result<(), Failure> {
    let VerifyArguments { recording: paths, with } = arguments;
    let recording = &(formats::of_recording(paths).whole)(paths).map_err(Failure::Input)?;
    let path = &paths[0];
    if let Some(broken) = &recording.broken {
        report_line(&format!("dynocar: {broken}"));
    }
    if recording.snapshots.is_empty() {
        let words = "no snapshots: nothing to verify";
        return Err(Failure::Input(format!("{}: {words}", path.display())));
    }
    let configurations = Configurations::from_recording(recording);
    let configurations =
        configurations.map_err(|it| Failure::Input(format!("{}: {it}", path.display())))?;
    let other = with.as_deref().map(DaemonConfig::load).transpose()?;
    let verified = verify(recording, &configurations);
    let (samples, snapshots) = (recording.samples.len(), recording.snapshots.len());
    let names = paths.iter().map(|it| it.display().to_string()).collect::<Vec<_>>();
    let names = names.join(", ");
    print(&format!("{names}: {samples} samples, {snapshots} snapshots\n"))?;
    print(&text(&verified))?;
    if let (Some(other), Some(file)) = (&other, with) {
        let newest = verified.last().map_or(0, |it| it.epoch);
        let recorded = configurations.of_epoch(newest).0;
        print(&overlay([recorded, other], &recording.samples, &file.display().to_string()))?;
    }
    if verified.iter().all(|it| it.outcome == ComparisonOutcome::Same) {
        Ok(())
    } else {
        Err(Failure::Verdict(1))
    }
}

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

/// Error of an attached configuration that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigurationProblem {
    /// No configuration is attached.
    #[error("no daemon's configuration is attached: there is nothing to verify by")]
    None,
    /// The configuration cannot be unpacked.
    #[error(transparent)]
    Unpacking(#[from] std::io::Error),
    /// The configuration is not valid.
    #[error("{folder}/daemon.toml: {problem}")]
    Malformed {
        /// The folder of the attached files.
        folder: String,
        /// Problem of the configuration.
        problem: String,
    },
    /// The daemon of this release refuses the configuration.
    #[error("attached {0}")]
    Refused(#[from] ConfigError),
}

/// A configuration with when it was seen.
struct SeenConfiguration {
    monotonic_ns: i64,
    config: DaemonConfig,
    keeps_state: bool,
}

/// The configurations of a recording, in the order in which they were seen.
pub struct Configurations {
    seen: Vec<SeenConfiguration>,
}

impl Configurations {
    /// Reads the attached configurations.
    ///
    /// # Errors
    ///
    /// See [`ConfigurationProblem`].
    pub fn from_recording(recording: &Recording) -> Result<Self, ConfigurationProblem> {
        let mut seen: Vec<SeenConfiguration> = Vec::new();
        for metadata in recording.metadata.iter().filter(|it| it.name == CONFIGURATION) {
            let number = |key| metadata.metadata.get(key).and_then(|it| it.parse::<i64>().ok());
            let (Some(index), Some(monotonic_ns)) = (number("number"), number("seen_monotonic_ns"))
            else {
                continue;
            };
            // Every file of a rotating recording has the same one once more.
            if seen.iter().all(|it| it.monotonic_ns != monotonic_ns) {
                let folder = folder_of_configuration(index as u32);
                let (config, keeps_state) = load(recording, &folder)?;
                seen.push(SeenConfiguration { monotonic_ns, config, keeps_state });
            }
        }
        if seen.is_empty() {
            return Err(ConfigurationProblem::None);
        }
        seen.sort_by_key(|it| it.monotonic_ns);
        Ok(Configurations { seen })
    }

    /// Returns the configuration of a daemon that started at a moment of the monotonic clock, and whether it
    /// keeps states: the first that was seen after that moment.
    pub fn of_epoch(&self, epoch: u64) -> (&DaemonConfig, bool) {
        let start_ns = i64::try_from(epoch).unwrap_or(i64::MAX);
        let found = self.seen.iter().find(|it| it.monotonic_ns >= start_ns);
        let newest = &self.seen[self.seen.len() - 1];
        let it = found.unwrap_or(newest);
        (&it.config, it.keeps_state)
    }
}

/// Unpacks a configuration with its files under the names they were attached by, and reads it.
fn load(recording: &Recording, folder: &str) -> Result<(DaemonConfig, bool), ConfigurationProblem> {
    let malformed = |problem: String| {
        let folder = folder.to_owned();
        ConfigurationProblem::Malformed { folder, problem }
    };
    let place = tempfile::tempdir()?;
    let mut text = None;
    for (name, content) in &recording.attachments {
        let Some(name) = name.strip_prefix(&format!("{folder}/")) else { continue };
        if name == "daemon.toml" {
            text = Some(String::from_utf8_lossy(content).into_owned());
        } else if !name.contains('/') {
            std::fs::write(place.path().join(name), content)?;
        }
    }
    let text = text.ok_or_else(|| malformed("not attached".into()))?;
    let mut table: Table = text.parse().map_err(|it: toml::de::Error| malformed(it.to_string()))?;
    let trains = table.get_mut("trains").and_then(Value::as_array_mut);
    for train in trains.into_iter().flatten().filter_map(Value::as_table_mut) {
        let id = train.get("id").and_then(Value::as_integer).unwrap_or(0);
        train.remove("candidates");
        for (key, name) in [("file", "train"), ("track", "track")] {
            if let Some(file) = train.get_mut(key) {
                *file = Value::String(format!("{name}-{id}.toml"));
            }
        }
    }
    // The folder of states is on another host; the report names it as a possible cause of a difference.
    let keeps_state = table.remove("state").is_some();
    // The models that were in force are attached in place of those declared.
    table.remove("models");
    let config = DaemonConfig::from_text(&place.path().join("daemon.toml"), &table.to_string())?;
    Ok((config, keeps_state))
}
