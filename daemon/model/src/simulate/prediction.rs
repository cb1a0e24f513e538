//! The open-loop simulation of a recorded run, and the error of the predicted speed.

use std::ops::Range;

use super::motion::{SPEED_MAX_MPS, STEP_MAX_S, speed_step};
use super::recording::{ForceModel, OpenLoopRecording, SampleRole};
use crate::force::ResolvedSample;

pub use crate::terms::wheel::STANDING_MPS;

/// How long the simulation runs before it takes up a measured speed again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Restart {
    /// Never: from the run's first sample to its end. The metric `full_run`.
    FullRun,
    /// Every this many seconds from the run's first sample. The metric `window60` is 60 s.
    EverySeconds(f64),
    /// At every departure, from rest: errors from stop to stop.
    AtDepartures,
}

impl Restart {
    /// Length in s of the windows of the metric `window60`.
    pub const WINDOW_S: f64 = 60.0;
    /// The metric `window60`.
    pub const WINDOW_60: Restart = Restart::EverySeconds(Restart::WINDOW_S);

    /// Returns the number of the first sample after another at which a measured speed is taken up again; the number
    /// of samples if there is none.
    fn next_behind(self, samples: &[ResolvedSample], index: usize) -> usize {
        match self {
            Restart::FullRun => samples.len(),
            Restart::AtDepartures => {
                let mut behind = index + 1..samples.len();
                behind.find(|at| departs(samples, *at)).unwrap_or(samples.len())
            }
            Restart::EverySeconds(seconds) => {
                let window_ns = ((seconds * 1e9) as i64).max(1);
                let since_ns = |sample: &ResolvedSample| sample.time_ns - samples[0].time_ns;
                let window = since_ns(&samples[index]) / window_ns;
                samples.partition_point(|sample| since_ns(sample) / window_ns <= window)
            }
        }
    }
}

/// Samples whose speeds together decide whether a starting speed is an outlier.
const START_SAMPLES: usize = 5;
/// They lie within this time in s: over a longer one the forces say too little.
const START_SPAN_S: f64 = 2.5;
/// A starting speed is an outlier when it differs by more than this in m/s from the speed that the samples after it
/// imply.
const START_TOLERANCE_MPS: f64 = 1.0;

/// Predicted measured speeds of one run; keeps its memory from one simulation to the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Prediction {
    speed_mps: Vec<f64>,
}

impl Prediction {
    /// Returns an empty prediction.
    pub fn new() -> Self {
        Prediction::default()
    }

    /// Returns the predicted measured speed in m/s at each sample; the measured one where the run cannot be
    /// simulated (see [`OpenLoopRecording::is_simulated`]).
    pub fn speed_mps(&self) -> &[f64] {
        &self.speed_mps
    }

    /// Simulates a run.
    ///
    /// The start is the measured speed, unless the samples after it show it to be an outlier:
    /// then it is the median of the starts that they would have given.
    pub fn simulate(
        &mut self,
        recording: &OpenLoopRecording,
        model: &impl ForceModel,
        restart: Restart,
    ) {
        Prediction::simulate_together(recording, model, [(self, restart)]);
    }

    /// Simulates a run in some ways at once: a processor works on one while the other waits for its last speed.
    pub fn simulate_together<const N: usize>(
        recording: &OpenLoopRecording,
        model: &impl ForceModel,
        mut ways: [(&mut Prediction, Restart); N],
    ) {
        let (samples, time_s, roles) = (recording.samples(), recording.time_s(), recording.roles());
        let scale = model.speed_scale();
        let mut at = ways.each_ref().map(|(_, restart)| (0.0, restart.next_behind(samples, 0)));
        ways.iter_mut().for_each(|(own, _)| own.speed_mps.clear());
        for (i, role) in roles.iter().enumerate() {
            for ((own, restart), (speed_mps, next)) in ways.iter_mut().zip(&mut at) {
                let restarts = i == *next;
                if restarts {
                    *next = restart.next_behind(samples, i);
                }
                match role {
                    SampleRole::Unknown => {
                        own.speed_mps.push(samples[i].speed_mps);
                        continue;
                    }
                    SampleRole::Starts => *speed_mps = start_speed(recording, model, i),
                    _ if restarts => *speed_mps = start_speed(recording, model, i),
                    SampleRole::HeldAtRest if *speed_mps == 0.0 => {}
                    SampleRole::HeldAtRest | SampleRole::Follows => {
                        *speed_mps = step(model, i - 1, *speed_mps, time_s[i] - time_s[i - 1]);
                    }
                }
                own.speed_mps.push(scale * *speed_mps);
            }
        }
    }
}

/// One step of Heun's method from a sample to the next, divided when long.
#[inline]
fn step(model: &impl ForceModel, from: usize, speed_mps: f64, step_s: f64) -> f64 {
    if step_s <= STEP_MAX_S {
        let at = |end: usize, speed| model.acceleration_mps2(from + end, speed);
        return speed_step(speed_mps, step_s, at).0;
    }
    let parts = (step_s / STEP_MAX_S).ceil();
    let part_s = step_s / parts;
    let at = |share: f64, speed: f64| {
        let (from_here, from_next) =
            (model.acceleration_mps2(from, speed), model.acceleration_mps2(from + 1, speed));
        from_here + share * (from_next - from_here)
    };
    (0..parts as usize).fold(speed_mps, |speed, part| {
        speed_step(speed, part_s, |end, speed| at((part + end) as f64 / parts, speed)).0
    })
}

/// True speed in m/s to start from at a sample.
fn start_speed(recording: &OpenLoopRecording, model: &impl ForceModel, index: usize) -> f64 {
    let (samples, time_s, roles) = (recording.samples(), recording.time_s(), recording.roles());
    let scale = model.speed_scale();
    let measured_mps = samples[index].speed_mps / scale;
    let mut starts = [measured_mps; START_SAMPLES];
    let mut count = 1;
    let mut gained_mps = 0.0;
    while count < START_SAMPLES {
        let next = index + count;
        let is_near = time_s.get(next).is_some_and(|time| time - time_s[index] <= START_SPAN_S);
        if !is_near || !matches!(roles[next], SampleRole::Follows | SampleRole::HeldAtRest) {
            break;
        }
        let next_mps = samples[next].speed_mps / scale;
        let step_s = time_s[next] - time_s[next - 1];
        let slope =
            model.acceleration_mps2(next - 1, next_mps) + model.acceleration_mps2(next, next_mps);
        // At rest the forces need not balance.
        gained_mps += if next_mps > 0.0 { 0.5 * step_s * slope } else { 0.0 };
        starts[count] = next_mps - gained_mps;
        count += 1;
    }
    let starts = &mut starts[..count];
    starts.sort_by(f64::total_cmp);
    let median_mps = starts[count / 2];
    let is_outlier = count >= 3 && (measured_mps - median_mps).abs() > START_TOLERANCE_MPS;
    if is_outlier { median_mps.clamp(0.0, SPEED_MAX_MPS) } else { measured_mps }
}

/// Returns true for the last sample of a stand: a train departs after it.
#[inline]
pub fn departs(samples: &[ResolvedSample], index: usize) -> bool {
    let stands = |at: usize| samples.get(at).is_some_and(|it| it.speed_mps <= STANDING_MPS);
    stands(index) && index + 1 < samples.len() && !stands(index + 1)
}

/// Samples at or below this measured speed in m/s do not count.
pub const MOVING_SPEED_MPS: f64 = 0.5;

/// Sum of squared differences between predicted and measured speed over moving samples; pooled
/// over runs by addition.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedError {
    /// Sum of squares in (m/s)².
    pub sum_of_squares: f64,
    /// Moving samples.
    pub count: usize,
}

impl SpeedError {
    /// Returns the error of a prediction over the run's moving, simulated samples.
    ///
    /// # Panics
    ///
    /// When the prediction belongs to another run.
    pub fn new(recording: &OpenLoopRecording, prediction: &Prediction) -> Self {
        SpeedError::within(recording, prediction, 0..recording.samples().len())
    }

    /// Returns the same over some samples of the run.
    ///
    /// # Panics
    ///
    /// When the prediction belongs to another run, or the run has not these samples.
    pub fn within(
        recording: &OpenLoopRecording,
        prediction: &Prediction,
        samples: Range<usize>,
    ) -> Self {
        assert_eq!(recording.samples().len(), prediction.speed_mps().len());
        let mut error = SpeedError::default();
        for i in samples {
            let measured_mps = recording.speed_mps()[i];
            if measured_mps > MOVING_SPEED_MPS && recording.is_simulated(i) {
                let difference = prediction.speed_mps()[i] - measured_mps;
                error.sum_of_squares += difference * difference;
                error.count += 1;
            }
        }
        error
    }

    /// Returns the root mean square in m/s; `None` without moving samples.
    pub fn rmse_mps(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.sum_of_squares / self.count as f64).sqrt())
    }
}

impl core::ops::Add for SpeedError {
    type Output = SpeedError;

    fn add(self, other: SpeedError) -> SpeedError {
        SpeedError {
            sum_of_squares: self.sum_of_squares + other.sum_of_squares,
            count: self.count + other.count,
        }
    }
}

impl core::iter::Sum for SpeedError {
    fn sum<I: Iterator<Item = SpeedError>>(errors: I) -> SpeedError {
        errors.fold(SpeedError::default(), |sum, error| sum + error)
    }
}
