//! What the estimators of a braking coefficient have in common.

use dynocar_shared::Uncertain;

use super::motion::StepInputs;
use crate::filter::NotPositiveDefinite;
use crate::filter::particle::ParticleError;

/// Why an engine failed; it has to be started anew.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum EngineError {
    /// A Kalman filter failed.
    #[error(transparent)]
    Filter(#[from] NotPositiveDefinite),
    /// A particle filter failed.
    #[error(transparent)]
    Particle(#[from] ParticleError),
    /// The estimate is not finite.
    #[error("expected a finite estimate, got {value}")]
    NotFinite {
        /// The estimate.
        value: f64,
    },
}

/// What is measured at one moment of braking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Distance in m since the brakes came on.
    pub distance_m: f64,
    /// Speed in m/s.
    pub speed_mps: f64,
    /// False while the wheels slide: the speed is not the train's.
    pub is_speed_valid: bool,
    /// The coefficient that the brake would need to act in full.
    pub demand: f64,
}

/// What an engine did with an observation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// It entered the window; the estimate stays as it was.
    Collected,
    /// The estimate was updated.
    Updated {
        /// Innovation over its predicted standard deviation, where there is one.
        normalised_innovation: Option<f64>,
    },
    /// It was refused as an outlier.
    Outlier,
    /// The motion is no longer that of the estimate; the engine started anew from here.
    Restarted,
}

/// A braking coefficient at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The coefficient: law times scale.
    pub coefficient: Uncertain,
    /// The scale of the law.
    pub scale: Uncertain,
    /// Covariance of the two.
    pub covariance: f64,
    /// The coefficient that the brake would need to act in full at that moment.
    pub demand: f64,
    /// Probability that the brake, not the rail, is the smaller one, where the engine weighs it.
    pub brake_limited: Option<f64>,
}

/// Learns a coefficient from one braking after another.
pub trait Engine: Send {
    /// Forgets the past and starts from a first observation.
    fn start(&mut self, first: &Observation);

    /// Takes the observation at the end of a step into account.
    ///
    /// # Errors
    ///
    /// When a factorisation fails or no particle is left.
    ///
    /// # Real-time
    ///
    /// Allocates nothing.
    fn step(&mut self, inputs: &StepInputs, observed: &Observation) -> Result<Step, EngineError>;

    /// Takes the variance of a measured distance in m² for another one from the next step on.
    fn set_distance_variance(&mut self, variance_m2: f64);

    /// The estimate, once there is one.
    fn estimate(&self) -> Option<Estimate>;
}
