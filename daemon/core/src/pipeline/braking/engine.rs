//! Common parts of the estimators of a braking coefficient.

use dynocar_model::terms::{adhesion, brake};
use dynocar_shared::Uncertain;

use super::motion::{MotionNoise, StepInputs};
use crate::pipeline::motion::MOVING_MPS;
use crate::pipeline::settings::{SettingError, require};
use crate::settings;

settings! {
    /// Prior of every braking pipeline on motion, measurement and braking.
    ///
    /// The defaults of the noise are those of the papers' simulation: a position measured within
    /// 0.1 m, and process noise uniform within 0.1 m and 0.1 km/h over steps of 0.2 s.
    #[derive(Copy)]
    BrakingSettings {
        /// Shortest time in s between two observations.
        interval_s: f64 = 0.2 => (above 0);
        /// A longer time in s between two observations ends the braking.
        gap_max_s: f64 = 2.0;
        /// Standard deviation of a measured position in m; a greater one is learned.
        position_std_m: f64 = 0.1 => (above 0);
        /// Standard deviation of a measured speed in m/s.
        speed_std_mps: f64 = 0.1 => (above 0);
        /// False when only the first speed of a braking is used, as in the papers.
        uses_speed: bool = true;
        /// Standard deviation in m that the position gains in 1 s about the model.
        position_walk_m: f64 = walk_per_sqrt_s(0.1) => (above 0);
        /// Standard deviation in m/s that the speed gains in 1 s about the model.
        speed_walk_mps: f64 = walk_per_sqrt_s(0.1 / 3.6) => (above 0);
        /// Standard deviation in m/s of the first speed of a braking.
        first_speed_std_mps: f64 = 0.2 => (above 0);
        /// Least brake force per weight that counts as braking.
        braking_min_per_weight: f64 = 0.01 => (above 0);
        /// Slowest speed in m/s at which the model is trusted.
        speed_min_mps: f64 = MOVING_MPS => (0 or more);
        /// True when the position does not come from the braked wheels, so that it holds while they
        /// slide.
        position_is_wheel_independent: bool = false;
        /// Standard deviation over value of the declared brake force.
        demand_relative_std: f64 = adhesion::DECLARED_BRAKE_STD => (above 0);
        /// Time in s within which a reported brake force builds up, as a time constant; 0 where it is the acting one.
        brake_lag_s: f64 = brake::SLOWEST_S => (0 to 60 "s");
        /// Greatest standard deviation over value of an estimate that counts.
        relative_std_max: f64 = 0.15 => (above 0);
        /// Age in s at which an estimate is stale.
        stale_after_s: f64 = 300.0 => (above 0);
    }
}

/// Returns the standard deviation that comes in 1 s from steps of 0.2 s, uniform within a half width, each of
/// variance w²/3.
fn walk_per_sqrt_s(half_width: f64) -> f64 {
    (half_width * half_width / 3.0 / 0.2).sqrt()
}

impl BrakingSettings {
    /// Refuses settings outside their ranges.
    ///
    /// # Errors
    ///
    /// Names key, value and range.
    pub fn check(&self) -> Result<(), SettingError> {
        self.check_ranges()?;
        let is_longer = self.gap_max_s >= self.interval_s && self.gap_max_s.is_finite();
        require(is_longer, "gap_max_s", self.gap_max_s, "at least interval_s")
    }

    /// Returns the noise of motion and measurement.
    pub fn noise(&self) -> MotionNoise {
        MotionNoise {
            distance_m2_per_s: self.position_walk_m.powi(2),
            speed_m2_per_s3: self.speed_walk_mps.powi(2),
            measured_distance_m2: self.position_std_m.powi(2),
            measured_speed_m2_per_s2: self.uses_speed.then_some(self.speed_std_mps.powi(2)),
        }
    }

    /// Returns whether an estimate is precise enough to be used.
    pub fn counts(&self, estimate: &BrakingEstimate) -> bool {
        let coefficient = estimate.coefficient;
        coefficient.std <= self.relative_std_max * coefficient.value.abs()
    }
}

/// Measurements at one moment of braking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrakingObservation {
    /// Distance in m since the brakes came on.
    pub distance_m: f64,
    /// Speed in m/s.
    pub speed_mps: f64,
    /// False while the wheels slide: the speed is not the train's.
    pub is_speed_valid: bool,
    /// The coefficient that the brake would need to act in full.
    pub demand: f64,
}

/// Result of an engine's update with an observation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EngineStep {
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
pub struct BrakingEstimate {
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
    fn start(&mut self, first: &BrakingObservation);

    /// Takes the observation at the end of a step into account. None when a factorisation fails, no
    /// particle is left or the estimate is not finite: the engine has to be started anew.
    ///
    /// # Real-time
    ///
    /// Allocates nothing.
    fn step(&mut self, inputs: &StepInputs, observed: &BrakingObservation) -> Option<EngineStep>;

    /// Takes the variance of a measured distance in m² for another one from the next step on.
    fn set_distance_variance(&mut self, variance_m2: f64);

    /// Returns the time in s by which the estimate lies back.
    fn lag_s(&self) -> f64 {
        0.0
    }

    /// Returns by how much of the force that a braking lacks on the average an estimate is low.
    fn lacking_share(&self) -> f64 {
        1.0
    }

    /// Returns the estimate, once there is one.
    fn estimate(&self) -> Option<BrakingEstimate>;
}
