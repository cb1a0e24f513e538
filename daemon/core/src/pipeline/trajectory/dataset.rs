//! Trajectories of whole runs, for a joint fit offline.

use dynocar_shared::RejectionReason;

use super::fit::{FitError, FitSettings, Stretch, TrajectoryFit, TrajectoryFitter};
use super::motion::{Motion, MotionTracker};
use super::quality::SpeedRange;
use super::step::{Step, StepRule};
use crate::force::ResolvedSample;

/// Shorter stretches say next to nothing and cost an initial speed each.
const STRETCH_SPEEDS_MIN: usize = 10;

/// Resolved samples of any number of runs, as stretches of unbroken motion.
///
/// Samples are stepped over in time. A stretch ends at a standstill, a gap, a slide and a
/// sample without forces.
#[derive(Clone, Debug, Default)]
pub struct TrajectoryData {
    tracker: MotionTracker,
    steps: Vec<Step>,
    speeds_mps: Vec<f64>,
    /// First step and first speed of every stretch.
    starts: Vec<(usize, usize)>,
    speeds: SpeedRange,
}

impl TrajectoryData {
    /// Takes in the next sample of a run, or says why it cannot be used.
    ///
    /// # Errors
    ///
    /// The reason, for the report's counts.
    pub fn push(&mut self, sample: &ResolvedSample) -> Result<(), RejectionReason> {
        match self.tracker.advance(sample) {
            Motion::Begin => {
                self.end_stretch();
                self.starts.push((self.steps.len(), self.speeds_mps.len()));
                self.speeds_mps.push(sample.speed_mps);
            }
            Motion::Continue(motion) => {
                self.steps.push(Step::from(&motion));
                self.speeds_mps.push(sample.speed_mps);
            }
            Motion::Standstill => self.end_stretch(),
            Motion::Unusable(reason) => {
                self.end_stretch();
                return Err(reason);
            }
        }
        Ok(())
    }

    /// Ends a run; the next sample belongs to another.
    pub fn end_run(&mut self) {
        self.end_stretch();
        self.tracker = MotionTracker::default();
    }

    /// Drops the newest stretch again when it is too short.
    fn end_stretch(&mut self) {
        let Some(&(step, speed)) = self.starts.last() else { return };
        let newest = &self.speeds_mps[speed..];
        if newest.len() < STRETCH_SPEEDS_MIN {
            self.steps.truncate(step);
            self.speeds_mps.truncate(speed);
            self.starts.pop();
        } else {
            newest.iter().for_each(|&speed_mps| self.speeds.push(speed_mps));
        }
    }

    /// The stretches so far.
    pub fn stretches(&self) -> Vec<Stretch<'_>> {
        let ends = self.starts.iter().skip(1).copied();
        let last = (self.steps.len(), self.speeds_mps.len());
        self.starts
            .iter()
            .zip(ends.chain([last]))
            .map(|(from, to)| Stretch {
                steps: &self.steps[from.0..to.0],
                speeds_mps: &self.speeds_mps[from.1..to.1],
            })
            .collect()
    }

    /// Lowest and highest speed in m/s of the stretches that have ended.
    pub fn speeds_mps(&self) -> Option<(f64, f64)> {
        self.speeds.get()
    }

    /// Fits all stretches jointly; the settings' rule is set to time.
    ///
    /// # Errors
    ///
    /// See [`FitError`].
    pub fn fit(&mut self, settings: &FitSettings) -> Result<TrajectoryFit, FitError> {
        self.end_run();
        let settings = FitSettings { rule: StepRule::Time, ..*settings };
        let stretches = self.stretches();
        TrajectoryFitter::with_capacity(stretches.len(), self.speeds_mps.len())
            .fit(&stretches, None, &settings)
    }
}

#[cfg(test)]
mod tests {
    use super::super::fit::Disturbance;
    use super::super::motion::tests::sample;
    use super::*;
    use crate::train::Davis;

    /// Coasting and traction at 5 Hz from a speed, by fine steps of the exact equation.
    fn run(data: &mut TrajectoryData, davis: &Davis, initial_mps: f64, first: u32) {
        let mut speed_mps = initial_mps;
        for index in 0..1500 {
            let force_n = if (index / 300) % 2 == 0 { 0.0 } else { 40_000.0 };
            data.push(&sample(first + index, speed_mps, force_n)).unwrap();
            let next_force_n = if ((index + 1) / 300) % 2 == 0 { 0.0 } else { 40_000.0 };
            for fine in 0..100 {
                let share = (f64::from(fine) + 0.5) / 100.0;
                let force_n = force_n + share * (next_force_n - force_n);
                let resistance_n = 981.0 * davis.w0_n_per_kn(speed_mps);
                speed_mps += 0.002 * (force_n - resistance_n) / 1.06e5;
            }
        }
        data.end_run();
    }

    #[test]
    fn runs_of_different_speeds_together_give_the_coefficients() {
        let truth = Davis { a: 1.5, b: 0.02, c: 0.0008 };
        let mut data = TrajectoryData::default();
        for (index, initial_mps) in [35.0, 24.0, 12.0, 30.0].into_iter().enumerate() {
            run(&mut data, &truth, initial_mps, 10_000 * index as u32);
        }
        assert_eq!(data.stretches().len(), 4);
        for disturbance in [Disturbance::None, Disturbance::Ratio(0.01)] {
            let settings = FitSettings { disturbance, ..FitSettings::new(StepRule::Time) };
            let fit = data.fit(&settings).unwrap();
            for speed_mps in [10.0, 20.0, 30.0] {
                let error = fit.davis.w0_n_per_kn(speed_mps) - truth.w0_n_per_kn(speed_mps);
                assert!(error.abs() < 2e-3, "{disturbance:?} {speed_mps}: {error:e}");
            }
            assert_eq!(fit.samples, 6000);
            assert!(fit.cluster_covariance.is_some());
        }
    }

    #[test]
    fn short_stretches_are_dropped_and_unusable_samples_named() {
        let mut data = TrajectoryData::default();
        for index in 0..5 {
            data.push(&sample(index, 10.0, 0.0)).unwrap();
        }
        let missing = ResolvedSample { gradient_permille: None, ..sample(5, 10.0, 0.0) };
        assert_eq!(data.push(&missing), Err(RejectionReason::Missing));
        for index in 6..40 {
            data.push(&sample(index, 10.0, 0.0)).unwrap();
        }
        data.end_run();
        assert_eq!(data.stretches().len(), 1);
        assert_eq!(data.stretches()[0].speeds_mps.len(), 34);
        assert_eq!(data.speeds_mps(), Some((10.0, 10.0)));
    }

    #[test]
    fn nothing_cannot_be_fitted() {
        let result = TrajectoryData::default().fit(&FitSettings::new(StepRule::Time));
        assert_eq!(result, Err(FitError::TooFewSamples { need: 3, got: 0 }));
    }
}
