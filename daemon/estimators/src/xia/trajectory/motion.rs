//! Steps that can be integrated, made from resolved samples, and the recent force that the estimated model does not
//! explain.

use dynocar_core::pipeline::motion::MOVING_MPS;
use dynocar_model::force::ResolvedSample;
use dynocar_model::train::Davis;
use dynocar_shared::{ParameterSnapshot, RejectionReason};

use super::step::{StepRule, TrajectoryStep};

/// Change that a sample makes to a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MotionUpdate {
    /// The trajectory begins anew at this sample's speed: the forces up to here are not known.
    Begin,
    /// One more step.
    Continue(MotionStep),
    /// The train stands; a trajectory ends.
    Standstill,
    /// The sample cannot be used; the trajectory ends.
    Unusable(RejectionReason),
}

/// The motion from one sample to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionStep {
    /// Time in s.
    pub duration_s: f64,
    /// Distance in m, from the measured speeds.
    pub distance_m: f64,
    /// Mean driving acceleration in m/s².
    pub drive_mps2: f64,
    /// Change of the driving acceleration over the step in m/s².
    pub drive_change_mps2: f64,
    /// κ in m/s² per N/kN.
    pub resistance_gain: f64,
}

impl From<&MotionStep> for TrajectoryStep {
    /// Returns a step in time.
    fn from(motion: &MotionStep) -> TrajectoryStep {
        TrajectoryStep {
            size: motion.duration_s,
            drive_mps2: motion.drive_mps2,
            resistance_gain: motion.resistance_gain,
        }
    }
}

/// Turns the samples of a train into steps.
///
/// Forces are taken to change linearly between two samples; with a controller that holds its
/// force over a cycle that is off by half a cycle's change, which alternates in sign.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionTracker {
    last: Option<Anchor>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Anchor {
    segment: u32,
    speed_mps: f64,
    drive_mps2: f64,
}

impl MotionTracker {
    /// Adds a sample.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn advance(&mut self, sample: &ResolvedSample) -> MotionUpdate {
        let last = self.last.take();
        if sample.is_sliding {
            return MotionUpdate::Unusable(RejectionReason::WheelSlide);
        }
        if sample.speed_mps <= MOVING_MPS {
            return MotionUpdate::Standstill;
        }
        let Some(driving_force_n) = sample.driving_force_n() else {
            return MotionUpdate::Unusable(RejectionReason::Missing);
        };
        let drive_mps2 = driving_force_n / sample.inertial_mass_kg;
        let resistance_gain = sample.weight_kn / sample.inertial_mass_kg;
        let speed_mps = sample.speed_mps;
        if !(drive_mps2.is_finite() && resistance_gain.is_finite() && speed_mps.is_finite()) {
            return MotionUpdate::Unusable(RejectionReason::NotFinite);
        }
        self.last = Some(Anchor { segment: sample.segment, speed_mps, drive_mps2 });
        match last {
            Some(last) if last.segment == sample.segment && sample.step_s > 0.0 => {
                MotionUpdate::Continue(MotionStep {
                    duration_s: sample.step_s,
                    distance_m: 0.5 * (last.speed_mps + speed_mps) * sample.step_s,
                    drive_mps2: 0.5 * (last.drive_mps2 + drive_mps2),
                    drive_change_mps2: drive_mps2 - last.drive_mps2,
                    resistance_gain,
                })
            }
            _ => MotionUpdate::Begin,
        }
    }
}

/// Time in s that the force is averaged over.
const AVERAGING_S: f64 = 20.0;

/// Returns the variance in 1/s² of the mean unexplained acceleration over that of the measured speed.
///
/// Differences of white noise telescope: an average with gain g over steps of h has the variance
/// R (g / h)² 2 / (2 - g).
fn variance_share(step_s: f64) -> f64 {
    let gain = (step_s / AVERAGING_S).min(1.0);
    let density = gain / step_s;
    density * density * 2.0 / (2.0 - gain)
}

/// Returns the standard deviation in m/s of the measured speed that a snapshot's `unexplained_force_std_n` was computed
/// with, for samples that come every `step_s`.
pub fn speed_noise_mps(unexplained_force_std_n: f64, inertial_mass_kg: f64, step_s: f64) -> f64 {
    unexplained_force_std_n / (inertial_mass_kg * variance_share(step_s).sqrt())
}

/// Exponential average of the acceleration that a model does not explain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UnexplainedForce {
    last_mps: f64,
    /// Mean unexplained acceleration in m/s².
    mean_mps2: f64,
    /// Its variance over that of the measured speed, in 1/s².
    variance_share: f64,
    inertial_mass_kg: f64,
}

impl UnexplainedForce {
    /// A trajectory begins at a measured speed.
    pub fn begin(&mut self, speed_mps: f64) {
        self.last_mps = speed_mps;
    }

    /// Takes in a step, the sample after it, and the model's coefficients.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn push(&mut self, motion: &MotionStep, sample: &ResolvedSample, davis: &Davis) {
        let step = TrajectoryStep::from(motion);
        let (expected, _) = StepRule::Time.advance_or_crawl(&step, davis, self.last_mps);
        let unexplained_mps2 = (sample.speed_mps - expected.speed_mps) / step.size;
        self.last_mps = sample.speed_mps;
        let gain = (step.size / AVERAGING_S).min(1.0);
        self.mean_mps2 += gain * (unexplained_mps2 - self.mean_mps2);
        self.variance_share = variance_share(step.size);
        self.inertial_mass_kg = sample.inertial_mass_kg;
    }

    /// Writes the force, retarding positive, for a variance of the measured speed.
    pub fn write(&self, snapshot: &mut ParameterSnapshot, speed_variance: f64) {
        snapshot.unexplained_force_n = -self.inertial_mass_kg * self.mean_mps2;
        let variance = speed_variance * self.variance_share;
        snapshot.unexplained_force_std_n = self.inertial_mass_kg * variance.sqrt();
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use dynocar_model::terms::Resistance;

    /// Returns a sample of a 100 t train with γ = 0.06 and every force known.
    pub fn sample(index: u32, speed_mps: f64, control_force_n: f64) -> ResolvedSample {
        ResolvedSample {
            time_ns: i64::from(index) * 200_000_000,
            step_s: if index == 0 { 0.0 } else { 0.2 },
            segment: 1,
            direction: 1.0,
            position_m: None,
            speed_mps,
            mass_kg: 1e5,
            is_mass_measured: false,
            inertial_mass_kg: 1.06e5,
            weight_kn: 981.0,
            traction_force_n: Some(control_force_n.max(0.0)),
            brake_force_n: Some((-control_force_n).max(0.0)),
            gradient_permille: Some(0.0),
            gradient_std_permille: 0.0,
            curvature_per_m: None,
            resistance: Resistance::BASIC,
            extra_n_per_kn: 0.0,
            since_cold_s: 0.0,
            tunnel_share: None,
            brake_cylinder_pressure_pa: None,
            ambient_temperature_degc: None,
            is_sliding: false,
        }
    }

    #[test]
    fn two_samples_of_a_segment_make_a_step_of_mean_force() {
        let mut tracker = MotionTracker::default();
        assert_eq!(tracker.advance(&sample(0, 10.0, 1.06e4)), MotionUpdate::Begin);
        let MotionUpdate::Continue(step) = tracker.advance(&sample(1, 10.2, 3.18e4)) else {
            panic!()
        };
        assert!((step.drive_mps2 - 0.2).abs() < 1e-12);
        assert!((step.distance_m - 2.02).abs() < 1e-12);
        assert!((step.resistance_gain - 9.81e-3 / 1.06).abs() < 1e-12);
    }

    #[test]
    fn no_step_leads_across_a_gap_a_stop_a_slide_or_a_missing_force() {
        let missing = ResolvedSample { traction_force_n: None, ..sample(1, 10.0, 0.0) };
        let sliding = ResolvedSample { is_sliding: true, ..sample(1, 10.0, 0.0) };
        let next_segment = ResolvedSample { segment: 2, ..sample(1, 10.0, 0.0) };
        for (between, expected) in [
            (missing, MotionUpdate::Unusable(RejectionReason::Missing)),
            (sliding, MotionUpdate::Unusable(RejectionReason::WheelSlide)),
            (sample(1, 0.0, 0.0), MotionUpdate::Standstill),
            (next_segment, MotionUpdate::Begin),
        ] {
            let mut tracker = MotionTracker::default();
            tracker.advance(&sample(0, 10.0, 0.0));
            assert_eq!(tracker.advance(&between), expected);
            assert_eq!(tracker.advance(&sample(2, 10.0, 0.0)), MotionUpdate::Begin);
        }
    }

    #[test]
    fn a_force_that_is_not_a_number_is_refused() {
        let mut tracker = MotionTracker::default();
        let bad = ResolvedSample { traction_force_n: Some(f64::NAN), ..sample(0, 10.0, 0.0) };
        assert_eq!(tracker.advance(&bad), MotionUpdate::Unusable(RejectionReason::NotFinite));
    }
}

#[cfg(test)]
mod unexplained_tests {
    use super::*;
    use crate::xia::trajectory::motion::tests::sample;
    use crate::xia::trajectory::motion::{MotionTracker, MotionUpdate};

    #[test]
    fn a_hidden_brake_shows_as_retarding_force() {
        let davis = Davis { a: 1.0, b: 0.0, c: 0.0 };
        let (mut tracker, mut force) = (MotionTracker::default(), UnexplainedForce::default());
        let mut speed_mps = 30.0;
        force.begin(speed_mps);
        for index in 0..1000 {
            let now = sample(index, speed_mps, 0.0);
            if let MotionUpdate::Continue(motion) = tracker.advance(&now) {
                force.push(&motion, &now, &davis);
            }
            // Resistance of 981 N and a hidden brake of 2000 N on 106 t.
            speed_mps -= 0.2 * (981.0 + 2000.0) / 1.06e5;
        }
        let mut snapshot = ParameterSnapshot::empty();
        force.write(&mut snapshot, 0.02 * 0.02);
        assert!((snapshot.unexplained_force_n - 2000.0).abs() < 1.0);
        // 0.02 m/s / 20 s on 106 t.
        assert!((snapshot.unexplained_force_std_n - 106.0).abs() < 1.0);
        let noise_mps = speed_noise_mps(snapshot.unexplained_force_std_n, 1.06e5, 0.2);
        assert!((noise_mps - 0.02).abs() < 1e-9, "what it was computed with: {noise_mps}");
    }
}
