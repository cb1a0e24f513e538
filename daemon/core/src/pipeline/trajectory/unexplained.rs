//! The force that the estimated model leaves unexplained, lately.

use dynocar_shared::ParameterSnapshot;

use super::step::{Step, StepRule};
use crate::force::ResolvedSample;
use crate::train::Davis;

/// Time in s that the force is averaged over.
const AVERAGING_S: f64 = 20.0;

/// Exponential average of the acceleration that a model does not explain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UnexplainedForce {
    last_mps: f64,
    /// Mean unexplained acceleration in m/s².
    mean_mps2: f64,
    variance: f64,
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
    pub fn push(
        &mut self,
        step: &Step,
        sample: &ResolvedSample,
        davis: &Davis,
        speed_variance: f64,
    ) {
        let (expected, _) = StepRule::Time.advance_or_crawl(step, davis, self.last_mps);
        let unexplained_mps2 = (sample.speed_mps - expected.speed_mps) / step.size;
        self.last_mps = sample.speed_mps;
        let gain = (step.size / AVERAGING_S).min(1.0);
        self.mean_mps2 += gain * (unexplained_mps2 - self.mean_mps2);
        // Differences of white noise telescope: an average with gain g over steps of h has the
        // variance R (g / h)² 2 / (2 - g).
        let density = gain / step.size;
        self.variance = speed_variance * density * density * 2.0 / (2.0 - gain);
        self.inertial_mass_kg = sample.inertial_mass_kg;
    }

    /// Writes the force, retarding positive.
    pub fn write(&self, snapshot: &mut ParameterSnapshot) {
        snapshot.unexplained_force_n = -self.inertial_mass_kg * self.mean_mps2;
        snapshot.unexplained_force_std_n = self.inertial_mass_kg * self.variance.sqrt();
    }
}
