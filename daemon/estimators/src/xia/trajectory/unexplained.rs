//! The force that the estimated model leaves unexplained, lately.

use dynocar_model::force::ResolvedSample;
use dynocar_model::train::Davis;
use dynocar_shared::ParameterSnapshot;

use super::motion::MotionStep;
use super::step::{Step, StepRule};

/// Time in s that the force is averaged over.
const AVERAGING_S: f64 = 20.0;

/// Variance in 1/s² of the mean unexplained acceleration over that of the measured speed.
///
/// Differences of white noise telescope: an average with gain g over steps of h has the variance
/// R (g / h)² 2 / (2 - g).
fn variance_share(step_s: f64) -> f64 {
    let gain = (step_s / AVERAGING_S).min(1.0);
    let density = gain / step_s;
    density * density * 2.0 / (2.0 - gain)
}

/// The standard deviation in m/s of the measured speed that a snapshot's `unexplained_force_std_n` was computed
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
        let step = Step::from(motion);
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
mod tests {
    use super::super::motion::tests::sample;
    use super::super::motion::{Motion, MotionTracker};
    use super::*;

    #[test]
    fn a_hidden_brake_shows_as_retarding_force() {
        let davis = Davis { a: 1.0, b: 0.0, c: 0.0 };
        let (mut tracker, mut force) = (MotionTracker::default(), UnexplainedForce::default());
        let mut speed_mps = 30.0;
        force.begin(speed_mps);
        for index in 0..1000 {
            let now = sample(index, speed_mps, 0.0);
            if let Motion::Continue(motion) = tracker.advance(&now) {
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
