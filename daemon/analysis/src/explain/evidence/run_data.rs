//! A run prepared for a fit: forces resolved, values cleaned, samples averaged in bins.

use std::sync::Arc;

use dynocar_core::pipeline::admission::Admission;
use dynocar_model::force::{ForceResolver, ResolvedSample};
use dynocar_model::simulate::{OpenLoopRecording, SimulateError};
use dynocar_model::terms::extra::Covariate;
use dynocar_model::train::{Corrections, TrainModel};
use dynocar_shared::{SampleField, TrainSample};

use crate::dataset::{
    DATASET_TRAIN, Dataset, ForceSource, GradientSource, PositionSource, Role, Run,
};
use crate::statistics::span;

use super::bins::{self, Bin};

use super::drift::drift_m;
use super::loads::estimate_loads;
use super::positions::{by_part_s, distance_ratio};
use super::sample_forces::DeclaredForces;
use super::slides::mark_slides;
use super::thinning::{MEAN_S, clean, thinned};

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
    pub recording: OpenLoopRecording,
    /// Declared forces at each sample.
    pub declared: DeclaredForces,
    /// Cleaned speed in m/s, lightly smoothed, at which resistances are evaluated.
    pub smooth_mps: Vec<f64>,
    /// Least and greatest position in m; `None` without one.
    pub span_m: Option<[f64; 2]>,
    /// Values of each covariate at each sample, by the number of the covariate; `NaN` where unknown.
    covariates: Vec<Vec<f64>>,
    /// Direction of travel at each sample, as `direction` of the run.
    pub directions: Vec<f64>,
    /// Share of the train inside mapped tunnels at each sample; none where it is not known.
    pub tunnel_share: Vec<f64>,
    /// Time in ns and motion segment of each sample.
    pub stamps: Vec<(i64, u32)>,
    /// The bins of all segments of motion, in order of time.
    pub bins: Vec<Bin>,
    /// Distance by position over distance by integrated speed, with its standard deviation, where
    /// positions are measured.
    pub distance_ratio: Option<(f64, f64)>,
    /// Seconds by which the speed is late by the position, for each part from stand to stand; empty
    /// where no positions are measured.
    pub speed_late_s: Vec<f64>,
    /// False where positions are integrated from the speed.
    pub is_position_recorded: bool,
    /// True where gradients come from an accelerometer, which feels them together with the acceleration.
    pub is_gradient_felt: bool,
    /// True where nobody weighed the load, and each leg has the mass that its traction moves.
    pub are_loads_estimated: bool,
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
    /// Power in W at each sample, `NaN` where missing; regenerated power is negative.
    pub power_w: Vec<f64>,
    /// True where it includes the auxiliary power.
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

    /// A covariate at each sample; `NaN` where it is not known.
    pub fn covariate(&self, of: Covariate) -> &[f64] {
        &self.covariates[of as usize]
    }

    /// The same at the samples from number `first` on; `None` where it is not known. Near each other in memory, as
    /// the samples themselves are not.
    pub fn known(&self, of: Covariate, first: usize) -> impl Iterator<Item = Option<f64>> + '_ {
        self.covariate(of)[first..].iter().map(|it| Some(*it).filter(|it| !it.is_nan()))
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

/// How densely the samples of a run that is made ready lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Density {
    /// As recorded.
    Recorded,
    /// About a second apart, each the mean of those that it stands for; a run whose force comes from its power stays
    /// as recorded.
    Thinned,
}

impl Density {
    /// Returns the time in s between samples that were recorded some s apart.
    pub fn step_s(self, recorded_s: f64) -> f64 {
        match self {
            Density::Recorded => recorded_s,
            Density::Thinned => recorded_s.max(MEAN_S),
        }
    }
}

/// Makes all runs of a dataset ready, as recorded.
///
/// # Errors
///
/// The first run without usable samples.
pub fn prepare(dataset: &Dataset) -> Result<Vec<RunData>, RunDataError> {
    prepare_at(dataset, Density::Recorded)
}

/// Makes all runs of a dataset ready.
///
/// # Errors
///
/// The first run without usable samples.
pub fn prepare_at(dataset: &Dataset, density: Density) -> Result<Vec<RunData>, RunDataError> {
    let train = &dataset.train;
    let reader = |train: Arc<TrainModel>, track| Reader {
        admission: Admission::new(DATASET_TRAIN, Arc::clone(&train)),
        resolver: ForceResolver::new(train, track),
    };
    // An odometer counts by the reported speed, without the corrections of a train's file.
    let reported = TrainModel { corrections: Corrections::default(), ..TrainModel::clone(train) };
    let mut readers = Readers {
        as_reported: reader(reported.into(), None),
        as_known: reader(train.clone(), dataset.track.clone()),
    };
    dataset.runs.iter().map(|run| prepare_run(train, (run, density), &mut readers)).collect()
}

/// Readers of all runs, one after the other.
struct Readers {
    /// Without the train's corrections and the line.
    as_reported: Reader,
    as_known: Reader,
}

/// Takes samples one after the other, as a daemon does.
struct Reader {
    admission: Admission,
    resolver: ForceResolver,
}

impl Reader {
    /// Those of a run, cleaned, with how many values were replaced.
    fn read(&mut self, rows: &[TrainSample]) -> (Vec<ResolvedSample>, usize) {
        let resolve = |row| Some(self.resolver.resolve(&self.admission.validate(row).ok()?));
        let mut samples: Vec<ResolvedSample> = rows.iter().filter_map(resolve).collect();
        let first_ns = samples.first().map_or(0, |sample| sample.time_ns);
        let time_s: Vec<f64> =
            samples.iter().map(|sample| (sample.time_ns - first_ns) as f64 * 1e-9).collect();
        let replaced = clean(&mut samples, bins::sampling_period_s(&time_s));
        (samples, replaced)
    }
}

/// Moves the positions of a run's rows by a distance in m for each of its samples.
fn move_positions(rows: &mut [TrainSample], samples: &[ResolvedSample], moved_m: &[f64]) {
    let mut moved = samples.iter().zip(moved_m).peekable();
    for row in rows {
        // Refused rows stay as they are.
        if let Some((_, moved_m)) = moved.next_if(|(sample, _)| sample.time_ns == row.time_ns)
            && let Some(position_m) = row.get(SampleField::Position)
        {
            row.set(SampleField::Position, position_m + moved_m);
        }
    }
}

/// Drops the rows before the first gradient and after the last, where some have one: of an altitude, none is known
/// before the train stands on ground that was driven over.
fn drop_unknown_ends(rows: &mut Vec<TrainSample>) {
    let has_gradient = |it: &TrainSample| it.get(SampleField::Gradient).is_some();
    if let Some(last) = rows.iter().rposition(has_gradient) {
        rows.truncate(last + 1);
        rows.drain(..rows.iter().position(has_gradient).unwrap_or(0));
    }
}

/// A run made ready, with an odometer's drift taken out before anything is looked up at its positions.
fn prepare_run(
    train: &TrainModel,
    (run, density): (&Run, Density),
    readers: &mut Readers,
) -> Result<RunData, RunDataError> {
    let numbered = run.samples.iter().map(|it| TrainSample { run: run.number, ..*it });
    let mut rows: Vec<TrainSample> = numbered.collect();
    drop_unknown_ends(&mut rows);
    let unusable = |source| RunDataError::Simulate { file: run.file.clone(), source };
    let is_position_recorded = run.position_source != PositionSource::IntegratedSpeed;
    if is_position_recorded {
        let reported =
            OpenLoopRecording::new(readers.as_reported.read(&rows).0).map_err(unusable)?;
        if let Some(moved_m) = drift_m(&reported) {
            move_positions(&mut rows, reported.samples(), &moved_m);
        }
    }
    let (mut samples, replaced) = readers.as_known.read(&rows);
    let are_loads_estimated = estimate_loads(train, &mut samples);
    if run.power().is_none() {
        mark_slides(&mut samples);
    }
    let mut recording = OpenLoopRecording::new(samples).map_err(unusable)?;
    let rejected = rows.len() - recording.samples().len();
    let first_ns = recording.samples().first().map_or(0, |sample| sample.time_ns);
    let distance_ratio = if is_position_recorded { distance_ratio(&recording) } else { None };
    let speed_late_s = match is_position_recorded {
        true => by_part_s(&recording),
        false => Vec::new(),
    };
    if density == Density::Thinned && run.power().is_none() {
        recording = OpenLoopRecording::new(thinned(&recording)).map_err(unusable)?;
    }
    let declared = DeclaredForces::of(recording.samples(), train.rotating_mass_factor);
    let smooth_mps = smoothed(&recording);
    let of_samples = |of: &Covariate| {
        recording.samples().iter().map(|sample| sample.covariate(*of).unwrap_or(f64::NAN)).collect()
    };
    let covariates = Covariate::ALL.iter().map(of_samples).collect();
    let each = || recording.samples().iter();
    let directions = each().map(|sample| sample.direction).collect();
    let tunnel_share = each().map(|sample| sample.tunnel_share.unwrap_or(0.0)).collect();
    let stamps = each().map(|sample| (sample.time_ns, sample.segment)).collect();
    let span_m = span(each().filter_map(|sample| sample.position_m));
    let bins = bins::bins(&recording);
    let power = RunPower::of(run, recording.samples());
    Ok(RunData {
        file: run.file.clone(),
        role: run.role,
        offset_s: first_ns as f64 * 1e-9,
        direction: f64::from(run.direction),
        recording,
        declared,
        smooth_mps,
        span_m,
        covariates,
        directions,
        tunnel_share,
        stamps,
        bins,
        distance_ratio,
        speed_late_s,
        is_position_recorded,
        is_gradient_felt: run.gradient_source == GradientSource::SpecificForce,
        are_loads_estimated,
        power,
        rejected,
        replaced,
    })
}

/// Mean over the second around each sample.
fn smoothed(recording: &OpenLoopRecording) -> Vec<f64> {
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
