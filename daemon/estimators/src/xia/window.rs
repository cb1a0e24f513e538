//! The sliding window of Xia 2023: points at even distances, steps between them.

use dynocar_core::pipeline::motion::jump_variance;

use crate::xia::trajectory::fit::MotionSegment;
use crate::xia::trajectory::motion::MotionStep;
use crate::xia::trajectory::step::{StepRule, TrajectoryStep};

/// The newest steps of unbroken motion, each about as long as the sampling distance.
///
/// The paper samples every 100 m; a controller samples in time. Samples are therefore gathered until the distance is
/// reached: the step's driving force is the mean of their forces over distance for eq. 7 (the same work) and over time
/// for the time rule (the same impulse), and the speed at its end is the last sample's own.
#[derive(Clone, Debug)]
pub struct StepWindow {
    rule: StepRule,
    interval_m: f64,
    steps: Vec<TrajectoryStep>,
    speeds_mps: Vec<f64>,
    /// Time in s of each step, and variance in (m/s)² of its error because forces may jump.
    missed: Vec<(f64, f64)>,
    open: OpenStep,
}

/// A slow train closes a step after this time in s, before its speed has changed much.
const DURATION_MAX_S: f64 = 10.0;

#[derive(Clone, Copy, Debug, Default)]
struct OpenStep {
    distance_m: f64,
    duration_s: f64,
    missed: f64,
    /// Integral of the driving acceleration over the step's measure.
    drive: f64,
    /// Integral of κ over the step's measure.
    gain: f64,
}

impl StepWindow {
    /// Returns an empty window of `steps` steps of at least a distance in m each.
    pub fn new(rule: StepRule, steps: usize, interval_m: f64) -> Self {
        StepWindow {
            rule,
            interval_m,
            steps: Vec::with_capacity(steps),
            speeds_mps: Vec::with_capacity(steps + 1),
            missed: Vec::with_capacity(steps),
            open: OpenStep::default(),
        }
    }

    /// Forgets everything; motion was broken.
    pub fn clear(&mut self) {
        self.steps.clear();
        self.speeds_mps.clear();
        self.missed.clear();
        self.open = OpenStep::default();
    }

    /// Starts anew from a measured speed.
    pub fn begin(&mut self, speed_mps: f64) {
        self.clear();
        self.speeds_mps.push(speed_mps);
    }

    /// Takes in the way to a sample and its speed; true when it closed a step.
    ///
    /// # Real-time
    ///
    /// Moves the window by one step at most, no allocation.
    pub fn push(&mut self, motion: &MotionStep, speed_mps: f64) -> bool {
        let measure = match self.rule {
            StepRule::Distance => motion.distance_m,
            StepRule::Time => motion.duration_s,
        };
        self.open.distance_m += motion.distance_m;
        self.open.duration_s += motion.duration_s;
        self.open.missed += jump_variance(motion.drive_change_mps2, motion.duration_s);
        self.open.drive += motion.drive_mps2 * measure;
        self.open.gain += motion.resistance_gain * measure;
        if self.open.distance_m < self.interval_m && self.open.duration_s < DURATION_MAX_S {
            return false;
        }
        let size = match self.rule {
            StepRule::Distance => self.open.distance_m,
            StepRule::Time => self.open.duration_s,
        };
        if self.steps.len() == self.steps.capacity() {
            self.steps.remove(0);
            self.speeds_mps.remove(0);
            self.missed.remove(0);
        }
        self.steps.push(TrajectoryStep {
            size,
            drive_mps2: self.open.drive / size,
            resistance_gain: self.open.gain / size,
        });
        self.speeds_mps.push(speed_mps);
        self.missed.push((self.open.duration_s, self.open.missed));
        self.open = OpenStep::default();
        true
    }

    /// Returns the variance in (m/s)² that the steps miss for each second because forces jump.
    pub fn missed_density(&self) -> f64 {
        let sum =
            |(time, variance): (f64, f64), step: &(f64, f64)| (time + step.0, variance + step.1);
        let (time_s, variance) = self.missed.iter().fold((0.0, 0.0), sum);
        if time_s > 0.0 { variance / time_s } else { 0.0 }
    }

    /// Steps in the window.
    pub fn count(&self) -> usize {
        self.steps.len()
    }

    /// Returns the window as a segment.
    pub fn segment(&self) -> MotionSegment<'_> {
        MotionSegment { steps: &self.steps, speeds_mps: &self.speeds_mps }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(drive_mps2: f64) -> MotionStep {
        MotionStep {
            duration_s: 1.0,
            distance_m: 30.0,
            drive_mps2,
            drive_change_mps2: 0.0,
            resistance_gain: 0.009,
        }
    }

    #[test]
    fn samples_are_gathered_until_the_distance_is_reached() {
        let mut window = StepWindow::new(StepRule::Distance, 3, 100.0);
        window.begin(30.0);
        let closed: Vec<bool> =
            (0..8).map(|i| window.push(&motion(f64::from(i)), 30.0 + f64::from(i))).collect();
        assert_eq!(closed, [false, false, false, true, false, false, false, true]);
        let segment = window.segment();
        assert_eq!(segment.speeds_mps, [30.0, 33.0, 37.0]);
        assert_eq!((segment.steps[0].size, segment.steps[0].drive_mps2), (120.0, 1.5));
        assert!((segment.steps[1].resistance_gain - 0.009).abs() < 1e-15);
    }

    #[test]
    fn a_full_window_drops_its_oldest_step() {
        let mut window = StepWindow::new(StepRule::Time, 2, 30.0);
        window.begin(30.0);
        for i in 0..5 {
            assert!(window.push(&motion(f64::from(i)), f64::from(i)));
        }
        let segment = window.segment();
        assert_eq!(segment.speeds_mps, [2.0, 3.0, 4.0]);
        assert_eq!((segment.steps[0].size, segment.steps[0].drive_mps2), (1.0, 3.0));
        assert_eq!(window.count(), 2);
    }
}
