//! How an acceleration that the model lacks behaves in time.

use crate::pipeline::motion::jump_variance;

/// Speed in m/s at which the bias of a behaviour that grows with speed is stated.
const GROWTH_REFERENCE_MPS: f64 = 20.0;

/// An Ornstein-Uhlenbeck process: how a bias behaves in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiasModel {
    /// Standard deviation in m/s².
    pub std_mps2: f64,
    /// Correlation time in s; infinite for a constant.
    pub time_s: f64,
    /// True when the bias is proportional to speed, as the drag of a headwind is; the
    /// deviation then holds at 20 m/s.
    pub grows_with_speed: bool,
}

impl BiasModel {
    /// A behaviour.
    pub fn new(std_mps2: f64, time_s: f64, grows_with_speed: bool) -> Self {
        BiasModel { std_mps2, time_s, grows_with_speed }
    }

    /// A behaviour that lasts for ever also believes that forces run straight between samples.
    pub fn knows_of_jumps(&self) -> bool {
        self.time_s.is_finite()
    }

    /// Variance in (m/s)² of what a step misses because the acceleration changes by so much over it.
    pub fn jump_variance(&self, change_mps2: f64, step_s: f64) -> f64 {
        if self.knows_of_jumps() { jump_variance(change_mps2, step_s) } else { 0.0 }
    }

    /// Share of the bias that is left after a time in s.
    pub fn keep(&self, step_s: f64) -> f64 {
        (-step_s / self.time_s).exp()
    }

    /// Variance in (m/s²)² of what comes to the bias while a share of it stays.
    pub fn noise_variance(&self, keep: f64) -> f64 {
        self.std_mps2 * self.std_mps2 * (1.0 - keep * keep)
    }

    /// Bias in m/s² at a speed in m/s for a stated bias of 1 m/s².
    pub fn shape(&self, speed_mps: f64) -> f64 {
        if self.grows_with_speed { speed_mps / GROWTH_REFERENCE_MPS } else { 1.0 }
    }
}
