//! Settings of the braking pipelines, and how each is built from them.

mod ekf;
mod em;
mod law;
mod smoother;

pub use ekf::EkfSettings;
pub use em::{EStep, EmSettings};
pub use law::LawSettings;
pub use smoother::{SmootherSettings, WalkSettings};

use dynocar_shared::PipelineKind;
use serde::Deserialize;

use super::engine::Engine;
use super::estimator::BrakingEstimator;
use super::gear::DeclaredGear;
use super::intake::{BrakingIntake, IntakeSettings, Quantity};
use super::motion::MotionNoise;
use super::report::ReportSettings;
use crate::pipeline::Estimator;
use crate::pipeline::settings::{SettingError, require};
use crate::train::TrainModel;

/// What every braking pipeline is told of motion, measurement and braking.
///
/// The defaults of the noise are those of the papers' simulation: a position measured within
/// 0.1 m, and process noise uniform within 0.1 m and 0.1 km/h over steps of 0.2 s.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BrakingSettings {
    /// Shortest time in s between two observations.
    pub interval_s: f64,
    /// A longer time in s between two observations ends the braking.
    pub gap_max_s: f64,
    /// Standard deviation of a measured position in m.
    pub position_std_m: f64,
    /// Standard deviation of a measured speed in m/s.
    pub speed_std_mps: f64,
    /// False when only the first speed of a braking is used, as in the papers.
    pub uses_speed: bool,
    /// Standard deviation in m that the position gains in 1 s about the model.
    pub position_walk_m: f64,
    /// Standard deviation in m/s that the speed gains in 1 s about the model.
    pub speed_walk_mps: f64,
    /// Standard deviation in m/s of the first speed of a braking.
    pub first_speed_std_mps: f64,
    /// Least brake force per weight that counts as braking.
    pub braking_min_per_weight: f64,
    /// Slowest speed in m/s at which the model is trusted.
    pub speed_min_mps: f64,
    /// True when the position does not come from the braked wheels, so that it holds while they
    /// slide.
    pub position_is_wheel_independent: bool,
    /// Standard deviation over value of the declared brake force.
    pub demand_relative_std: f64,
    /// Greatest standard deviation over value of an estimate that counts.
    pub relative_std_max: f64,
    /// Age in s at which an estimate is stale.
    pub stale_after_s: f64,
}

impl Default for BrakingSettings {
    fn default() -> Self {
        // A uniform step of half width w has variance w²/3; 0.2 s make it a rate.
        let walk = |half_width: f64| (half_width * half_width / 3.0 / 0.2).sqrt();
        BrakingSettings {
            interval_s: 0.2,
            gap_max_s: 2.0,
            position_std_m: 0.1,
            speed_std_mps: 0.1,
            uses_speed: true,
            position_walk_m: walk(0.1),
            speed_walk_mps: walk(0.1 / 3.6),
            first_speed_std_mps: 0.2,
            braking_min_per_weight: 0.01,
            speed_min_mps: 1.0,
            position_is_wheel_independent: false,
            demand_relative_std: 0.03,
            relative_std_max: 0.15,
            stale_after_s: 300.0,
        }
    }
}

impl BrakingSettings {
    fn check(&self) -> Result<(), SettingError> {
        require_positive("interval_s", self.interval_s)?;
        require_positive("position_std_m", self.position_std_m)?;
        require_positive("speed_std_mps", self.speed_std_mps)?;
        require_positive("position_walk_m", self.position_walk_m)?;
        require_positive("speed_walk_mps", self.speed_walk_mps)?;
        require_positive("first_speed_std_mps", self.first_speed_std_mps)?;
        require_positive("braking_min_per_weight", self.braking_min_per_weight)?;
        require_positive("demand_relative_std", self.demand_relative_std)?;
        require_positive("relative_std_max", self.relative_std_max)?;
        require_positive("stale_after_s", self.stale_after_s)?;
        let is_longer = self.gap_max_s >= self.interval_s && self.gap_max_s.is_finite();
        require(is_longer, "gap_max_s", self.gap_max_s, "at least interval_s")?;
        let is_moving = self.speed_min_mps >= 0.0 && self.speed_min_mps.is_finite();
        require(is_moving, "speed_min_mps", self.speed_min_mps, "at least 0")
    }

    fn noise(&self) -> MotionNoise {
        MotionNoise {
            distance_m2_per_s: self.position_walk_m.powi(2),
            speed_m2_per_s3: self.speed_walk_mps.powi(2),
            measured_distance_m2: self.position_std_m.powi(2),
            measured_speed_m2_per_s2: self.uses_speed.then_some(self.speed_std_mps.powi(2)),
        }
    }

    fn intake(&self, quantity: Quantity, train: &TrainModel) -> BrakingIntake {
        let settings = IntakeSettings {
            interval_s: self.interval_s,
            gap_max_s: self.gap_max_s,
            braking_min_per_weight: self.braking_min_per_weight,
            speed_min_mps: self.speed_min_mps,
            position_is_wheel_independent: self.position_is_wheel_independent,
        };
        BrakingIntake::new(quantity, settings, train)
    }

    fn estimator<E: Engine + 'static>(
        &self,
        kind: PipelineKind,
        quantity: Quantity,
        train: &TrainModel,
        engine: E,
    ) -> Box<dyn Estimator> {
        let report = ReportSettings {
            relative_std_max: self.relative_std_max,
            demand_relative_std: self.demand_relative_std,
            has_law_scale: kind == PipelineKind::AdhesionLaw,
        };
        let intake = self.intake(quantity, train);
        let stale_after_s = self.stale_after_s;
        Box::new(BrakingEstimator::new(kind, quantity, intake, engine, report, stale_after_s))
    }
}

/// Which factor of the brake force a brake pipeline reports; the other is held as declared, since
/// only their product acts on the train.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BrakeFactor {
    /// Disc friction; the braking ratio is held.
    #[default]
    Friction,
    /// Braking ratio; the disc friction is held.
    Ratio,
}

impl BrakeFactor {
    fn quantity(self) -> Quantity {
        match self {
            BrakeFactor::Friction => Quantity::Friction,
            BrakeFactor::Ratio => Quantity::Ratio,
        }
    }
}

/// Adhesion that stands for a declared one where nothing is declared.
const ADHESION_REFERENCE: f64 = 0.1;

/// The declared value of a quantity.
fn declared(quantity: Quantity, train: &TrainModel) -> Option<f64> {
    let gear = DeclaredGear::of(&train.brake_gear);
    match quantity {
        Quantity::Adhesion => None,
        Quantity::Friction => gear.map(|gear| gear.friction),
        Quantity::Ratio => gear.map(|gear| gear.ratio),
    }
}

fn require_positive(key: &'static str, value: f64) -> Result<(), SettingError> {
    require(value > 0.0 && value.is_finite(), key, value, "a finite number above 0")
}
