//! Repeated computation of the snapshots of one pipeline of one daemon.

use std::collections::BTreeMap;

use dynocar::config::{DaemonConfig, TrainConfig, build_pipeline};
use dynocar_core::pipeline::Pipeline;
use dynocar_shared::{ParameterSnapshot, TrainSample};

use super::{Configurations, STAMPS};
use dynocar_mcap::recording::Recording;
use dynocar_mcap::schema::SNAPSHOT_FIELDS;

/// A difference between a computed snapshot and the recorded one.
#[derive(Clone, Debug, PartialEq)]
pub struct SnapshotDifference {
    /// The sample behind both.
    pub sample: u64,
    /// The field.
    pub field: &'static str,
    /// Recorded value, in words.
    pub recorded: String,
    /// Computed value, in words.
    pub computed: String,
}

/// Result of the comparison of a pipeline's snapshots.
#[derive(Clone, Debug, PartialEq)]
pub enum ComparisonOutcome {
    /// Every bit is the same.
    Same,
    /// The recording begins later than the daemon.
    BeginsLate {
        /// Samples that the pipeline had taken before the first that is recorded.
        before: u64,
    },
    /// The daemon missed samples that the recording holds, or the other way round: the recorded samples are not those
    /// that the pipeline took.
    OtherSamples {
        /// The last sample up to which both agree; none when it is 0.
        agree_up_to: u64,
        /// Reason for it.
        why: &'static str,
    },
    /// The configuration has no such pipeline for the train.
    NotConfigured,
    /// A bit is another.
    Differs(SnapshotDifference),
}

/// A pipeline of a daemon for a train, with the fate of its snapshots.
#[derive(Clone, Debug, PartialEq)]
pub struct Verified {
    /// The daemon's start.
    pub epoch: u64,
    /// The train.
    pub train: u64,
    /// The pipeline's number.
    pub index: u32,
    /// Its name, or its kind's where the configuration has none.
    pub name: String,
    /// Snapshots recorded.
    pub recorded: usize,
    /// Those that are the same to the bit, from the first on.
    pub same: usize,
    /// Result for the rest.
    pub outcome: ComparisonOutcome,
    /// True where the daemon may have started from a kept state.
    pub keeps_state: bool,
}

/// Computes every snapshot of a recording again.
pub fn verify(recording: &Recording, configurations: &Configurations) -> Vec<Verified> {
    let mut groups: BTreeMap<(u64, u64, u32), Vec<&ParameterSnapshot>> = BTreeMap::new();
    for it in &recording.snapshots {
        groups.entry((it.epoch, it.train_id, it.pipeline_index)).or_default().push(it);
    }
    let mut verified = Vec::new();
    for ((epoch, train, index), mut recorded) in groups {
        recorded.sort_by_key(|it| it.sequence);
        let (config, keeps_state) = configurations.of_epoch(epoch);
        let samples: Vec<&TrainSample> =
            recording.samples.iter().filter(|it| it.train_id == train).collect();
        let settings = config.pipelines.get(index as usize);
        let name = match settings {
            Some(settings) => settings.name.clone(),
            None => recorded[0].pipeline_kind().map_or("unknown".into(), |it| it.to_string()),
        };
        let (same, outcome) = match pipeline_of(config, train, index) {
            None => (0, ComparisonOutcome::NotConfigured),
            Some(make) => compare(&samples, &recorded, &make),
        };
        let recorded = recorded.len();
        verified.push(Verified { epoch, train, index, name, recorded, same, outcome, keeps_state });
    }
    verified
}

/// Returns a new pipeline.
fn pipeline_of<'c>(
    config: &'c DaemonConfig,
    train: u64,
    index: u32,
) -> Option<impl Fn() -> Option<Pipeline> + use<'c>> {
    let settings = config.pipelines.get(index as usize)?;
    let train: &TrainConfig = config.trains.iter().find(|it| it.id.0 == train)?;
    settings.trains.contains(&train.id).then_some(())?;
    // The configuration was checked with its settings.
    Some(move || build_pipeline(settings, index, train).ok())
}

/// Compares a daemon's snapshots of a pipeline, in order, with those computed from samples.
fn compare(
    samples: &[&TrainSample],
    recorded: &[&ParameterSnapshot],
    make: &impl Fn() -> Option<Pipeline>,
) -> (usize, ComparisonOutcome) {
    let first = recorded.iter().find(|it| it.sequence > 0);
    let start = match first.map(|first| start_of(samples, first)) {
        // The daemon has taken no sample yet.
        None => 0,
        Some(Ok(start)) => start,
        Some(Err(outcome)) => return (0, outcome),
    };
    let samples = &samples[start..];
    let Some(lost) = lost_before(samples, first.copied(), make) else {
        return (0, ComparisonOutcome::NotConfigured);
    };
    let Some(mut pipeline) = make() else { return (0, ComparisonOutcome::NotConfigured) };
    if let Some(sample) = samples.first() {
        pipeline.count_from(sample.sequence.saturating_sub(1 + lost));
    }
    let mut rest = samples.iter();
    for (same, it) in recorded.iter().enumerate() {
        let agree_up_to = recorded[..same].last().map_or(0, |it| it.sample_sequence);
        let others = |why| (same, ComparisonOutcome::OtherSamples { agree_up_to, why });
        if it.model_hash != pipeline.snapshot().model_hash {
            return others("another model was in force than the attached one");
        }
        while pipeline.snapshot().sequence < it.sequence {
            let is_newest = pipeline.snapshot().sample_sequence == it.sample_sequence;
            let missed = it.samples_lost.saturating_sub(pipeline.snapshot().samples_lost);
            if is_newest && missed > 0 {
                // The daemon counted the samples that a vanished controller left behind as lost.
                pipeline.count_up_to(it.sample_sequence + missed);
                continue;
            }
            let Some(sample) = rest.next().filter(|_| !is_newest) else {
                return others("the daemon took samples that are not recorded");
            };
            pipeline.process(sample);
        }
        let computed = pipeline.snapshot();
        if computed.sample_sequence != it.sample_sequence {
            return others("the daemon took other samples");
        }
        if let Some(difference) = difference(it, computed) {
            return (same, ComparisonOutcome::Differs(difference));
        }
    }
    (recorded.len(), ComparisonOutcome::Same)
}

/// Returns the index of the first sample that the pipeline took: a snapshot's `sequence` says how many it had
/// taken by the newest.
fn start_of(
    samples: &[&TrainSample],
    first: &ParameterSnapshot,
) -> Result<usize, ComparisonOutcome> {
    let is_behind = |it: &&TrainSample| {
        (it.sequence, it.time_ns) == (first.sample_sequence, first.sample_time_ns)
    };
    match samples.iter().position(is_behind) {
        None => Err(ComparisonOutcome::OtherSamples {
            agree_up_to: 0,
            why: "the sample behind its first snapshot is not recorded",
        }),
        Some(index) => {
            let taken = index as u64 + 1;
            match first.sequence.checked_sub(taken) {
                None => Ok((taken - first.sequence) as usize),
                Some(0) => Ok(0),
                Some(before) => Err(ComparisonOutcome::BeginsLate { before }),
            }
        }
    }
}

/// Returns how many samples the pipeline counted as lost before its first.
fn lost_before(
    samples: &[&TrainSample],
    first: Option<&ParameterSnapshot>,
    make: &impl Fn() -> Option<Pipeline>,
) -> Option<u64> {
    let (Some(first), Some(sample)) = (first, samples.first()) else { return Some(0) };
    let mut pipeline = make()?;
    pipeline.count_from(sample.sequence.saturating_sub(1));
    for sample in samples {
        if pipeline.snapshot().sequence >= first.sequence {
            break;
        }
        pipeline.process(sample);
    }
    Some(first.samples_lost.saturating_sub(pipeline.snapshot().samples_lost))
}

/// Returns the first field, but for stamps, that is not the same to the bit.
fn difference(
    recorded: &ParameterSnapshot,
    computed: &ParameterSnapshot,
) -> Option<SnapshotDifference> {
    let (one, other) = (recorded.fields(), computed.fields());
    for field in SNAPSHOT_FIELDS.iter().filter(|it| !STAMPS.contains(&it.layout.name)) {
        let (one, other) = (one[field.index], other[field.index]);
        let differs = |&index: &usize| one.word(index) != other.word(index);
        let Some(index) = (0..one.count()).find(differs) else { continue };
        let shown = |word: u64| match field.entry_type() {
            "f64" => f64::from_bits(word).to_string(),
            "i64" => (word as i64).to_string(),
            _ => word.to_string(),
        };
        let (recorded_word, computed_word) = (one.word(index), other.word(index));
        return Some(SnapshotDifference {
            sample: recorded.sample_sequence,
            field: field.layout.name,
            recorded: shown(recorded_word),
            computed: shown(computed_word),
        });
    }
    None
}
