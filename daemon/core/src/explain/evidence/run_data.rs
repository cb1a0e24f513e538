//! A run made ready for fitting: resolved, cleaned and binned.

use dynocar_shared::TrainSample;

use crate::dataset::{Dataset, ForceSource, PositionSource, Role, Run};
use crate::force::{ForceResolver, ResolvedSample};
use crate::simulate::{BridgeLimits, Recording, SimulateError};
use crate::train::TrainModel;
use crate::validation::{ValidationLimits, Validator};

use super::cleaning;
use super::sample_forces::SampleForces;

/// Width in s of a bin over which speeds are averaged.
const BIN_S: f64 = 2.0;
/// A bin is at least this many sampling periods wide.
const BIN_SAMPLES_MIN: f64 = 2.0;
/// Below this speed in m/s the train's motion is not used: holding brakes and stiction act.
const MOVING_MPS: f64 = 0.8;
/// A longer step in s between samples ends a segment of motion.
const SEGMENT_GAP_MAX_S: f64 = 5.0;
/// Segments of fewer bins say nothing.
const SEGMENT_BINS_MIN: usize = 4;

/// Mean over a few samples of one segment of motion, with the features of its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin {
    /// First sample.
    pub first: usize,
    /// One past the last sample.
    pub end: usize,
    /// Number of the segment of motion within the run, from 0.
    pub segment: usize,
    /// Mean time in s since the run's first sample.
    pub time_s: f64,
    /// Mean measured speed in m/s.
    pub speed_mps: f64,
}

impl Bin {
    /// The sample in the middle.
    pub fn middle(&self) -> usize {
        (self.first + self.end) / 2
    }
}

/// A run, ready for fitting and for open-loop simulation.
#[derive(Clone, Debug)]
pub struct RunData {
    /// Path of its file, as the dataset names it.
    pub file: String,
    /// Fit or holdout.
    pub role: Role,
    /// Time in s of the run's first sample in the recording's own count.
    pub offset_s: f64,
    /// +1 while the chainage grows, -1 while it falls.
    pub direction: f64,
    /// The cleaned run.
    pub recording: Recording,
    /// What the declared model says of each sample.
    pub declared: Vec<SampleForces>,
    /// Cleaned speed in m/s, lightly smoothed, at which resistances are evaluated.
    pub smooth_mps: Vec<f64>,
    /// The bins of all segments of motion, in order of time.
    pub bins: Vec<Bin>,
    /// Way by position over way by integrated speed, with its standard deviation, where
    /// positions are measured.
    pub way_ratio: Option<(f64, f64)>,
    /// The power from which the force comes.
    pub power: Option<RunPower>,
    /// Samples that validation refused.
    pub rejected: usize,
    /// Values replaced as outliers.
    pub replaced: usize,
}

/// The power that a run's force comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct RunPower {
    /// Power in W at each sample, `NaN` where missing; what is fed back is negative.
    pub power_w: Vec<f64>,
    /// True where it holds what is fed beside the drive.
    pub has_auxiliaries: bool,
    /// True where the brake force comes from it too.
    pub is_brake: bool,
}

impl RunPower {
    /// Of a run, at the times of samples.
    fn of(run: &Run, samples: &[ResolvedSample]) -> Option<Self> {
        let (recorded, has_auxiliaries) = run.power()?;
        let mut rows = run.samples.iter().zip(recorded);
        let at = |sample: &ResolvedSample| {
            // Refused rows are left out, none is added.
            let row = rows.find(|(row, _)| row.time_ns == sample.time_ns);
            row.and_then(|(_, power_w)| *power_w).unwrap_or(f64::NAN)
        };
        let power_w = samples.iter().map(at).collect();
        let is_brake = run.brake_source == ForceSource::Power;
        Some(RunPower { power_w, has_auxiliaries, is_brake })
    }
}

/// Why a run cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RunDataError {
    /// No sample passed validation or has forces.
    #[error("{file}: {source}")]
    Simulate {
        /// The run's file.
        file: String,
        /// Why it cannot be simulated.
        source: SimulateError,
    },
}

impl RunData {
    /// The samples, cleaned.
    pub fn samples(&self) -> &[ResolvedSample] {
        self.recording.samples()
    }

    /// Time in s of moving, used motion.
    pub fn moving_s(&self) -> f64 {
        let time_s = self.recording.time_s();
        self.bins.iter().map(|bin| time_s[bin.end - 1] - time_s[bin.first]).sum()
    }

    /// Duration of the run in s.
    pub fn duration_s(&self) -> f64 {
        self.recording.time_s().last().copied().unwrap_or(0.0)
    }
}

/// Makes all runs of a dataset ready.
///
/// # Errors
///
/// The first run without usable samples.
pub fn prepare(dataset: &Dataset) -> Result<Vec<RunData>, RunDataError> {
    let train = &dataset.train;
    let limits = ValidationLimits::for_train(train.mass_kg);
    let mut validator = Validator::new(crate::dataset::DATASET_TRAIN, train.mass_kg, limits);
    let mut resolver = ForceResolver::new(train.clone(), dataset.track.clone());
    let mut resolve =
        |sample: &TrainSample| validator.check(sample).ok().map(|valid| resolver.resolve(&valid));
    dataset.runs.iter().map(|run| prepare_run(train, run, &mut resolve)).collect()
}

/// A run whose samples are resolved one after the other, as a daemon takes them.
fn prepare_run(
    train: &TrainModel,
    run: &Run,
    resolve: &mut dyn FnMut(&TrainSample) -> Option<ResolvedSample>,
) -> Result<RunData, RunDataError> {
    let numbered = run.samples.iter().map(|it| TrainSample { run: run.number, ..*it });
    let mut samples: Vec<ResolvedSample> = numbered.filter_map(|sample| resolve(&sample)).collect();
    let rejected = run.samples.len() - samples.len();
    let first_ns = samples.first().map_or(0, |sample| sample.time_ns);
    let time_s: Vec<f64> =
        samples.iter().map(|sample| (sample.time_ns - first_ns) as f64 * 1e-9).collect();
    let replaced = cleaning::clean(&mut samples, sampling_period_s(&time_s));
    let recording = Recording::new(samples, BridgeLimits::default())
        .map_err(|source| RunDataError::Simulate { file: run.file.clone(), source })?;
    let declared = recording
        .samples()
        .iter()
        .map(|sample| SampleForces::declared(sample, train.rotating_mass_factor))
        .collect();
    let smooth_mps = smoothed(&recording);
    let bins = bins(&recording);
    let way_ratio = match run.position_source {
        PositionSource::IntegratedSpeed => None,
        _ => way_ratio(&recording),
    };
    let power = RunPower::of(run, recording.samples());
    Ok(RunData {
        file: run.file.clone(),
        role: run.role,
        offset_s: first_ns as f64 * 1e-9,
        direction: f64::from(run.direction),
        recording,
        declared,
        smooth_mps,
        bins,
        way_ratio,
        power,
        rejected,
        replaced,
    })
}

/// Mean over the second around each sample.
fn smoothed(recording: &Recording) -> Vec<f64> {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let (mut from, mut to) = (0, 0);
    let mut sum = 0.0;
    (0..samples.len())
        .map(|i| {
            while to < samples.len() && time_s[to] <= time_s[i] + 0.5 {
                sum += samples[to].speed_mps;
                to += 1;
            }
            while time_s[from] < time_s[i] - 0.5 {
                sum -= samples[from].speed_mps;
                from += 1;
            }
            (sum / (to - from) as f64).max(0.0)
        })
        .collect()
}

fn sampling_period_s(time_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if steps.is_empty() {
        return BIN_S;
    }
    let at = steps.len() / 2;
    *steps.select_nth_unstable_by(at, f64::total_cmp).1
}

fn bins(recording: &Recording) -> Vec<Bin> {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let width_s = BIN_S.max(BIN_SAMPLES_MIN * sampling_period_s(time_s));
    let usable = |i: usize| recording.is_simulated(i) && samples[i].speed_mps > MOVING_MPS;
    let mut bins: Vec<Bin> = Vec::new();
    let mut segment = 0;
    let mut i = 0;
    while i < samples.len() {
        if !usable(i) {
            i += 1;
            continue;
        }
        let mut end = i + 1;
        while end < samples.len()
            && usable(end)
            && time_s[end] - time_s[end - 1] <= SEGMENT_GAP_MAX_S
        {
            end += 1;
        }
        let segment_bins = segment_bins(recording, i, end, segment, width_s);
        if segment_bins.len() >= SEGMENT_BINS_MIN {
            bins.extend(segment_bins);
            segment += 1;
        }
        i = end;
    }
    bins
}

fn segment_bins(
    recording: &Recording,
    first: usize,
    end: usize,
    segment: usize,
    width_s: f64,
) -> Vec<Bin> {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let mut bins = Vec::new();
    let mut from = first;
    while from < end {
        // The small margin keeps rounded times from splitting a bin.
        let until_s = time_s[from] + width_s * (1.0 - 1e-6);
        let mut to = from + 1;
        while to < end && time_s[to] < until_s {
            to += 1;
        }
        let count = (to - from) as f64;
        let mean = |value: &dyn Fn(usize) -> f64| (from..to).map(value).sum::<f64>() / count;
        bins.push(Bin {
            first: from,
            end: to,
            segment,
            time_s: mean(&|i| time_s[i]),
            speed_mps: mean(&|i| samples[i].speed_mps),
        });
        from = to;
    }
    bins
}

/// Total way by position over total way by integrated speed.
///
/// Balises correct the position while the odometer shares the error of the wheel diameter, so
/// that the ratio over many kilometres tells the diameter. The standard deviation assumes an
/// error of 10 m at either end, the distance that an odometer drifts between two balises at a
/// scale error of 1 %.
fn way_ratio(recording: &Recording) -> Option<(f64, f64)> {
    const END_ERROR_M: f64 = 10.0;
    const WAY_MIN_M: f64 = 1500.0;
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let (mut by_position_m, mut by_speed_m) = (0.0, 0.0);
    let mut last: Option<usize> = None;
    for (i, sample) in samples.iter().enumerate() {
        let Some(position_m) = sample.position_m else { continue };
        if let Some(k) = last
            && time_s[i] - time_s[k] <= SEGMENT_GAP_MAX_S
        {
            by_position_m += sample.direction * (position_m - samples[k].position_m?);
            let mean_mps = 0.5 * (sample.speed_mps + samples[k].speed_mps);
            by_speed_m += mean_mps * (time_s[i] - time_s[k]);
        }
        last = Some(i);
    }
    if by_speed_m < WAY_MIN_M || by_position_m < 0.5 * by_speed_m {
        return None;
    }
    Some((by_position_m / by_speed_m, END_ERROR_M * std::f64::consts::SQRT_2 / by_speed_m))
}
