//! Settings of the braking pipelines, and how each is built from them.

mod ekf;
mod law;
mod smoother;

pub use ekf::EkfSettings;
pub use law::LawSettings;
pub use smoother::{SmootherSettings, WalkSettings};

use dynocar_model::terms::adhesion;
use dynocar_model::train::TrainModel;
use dynocar_shared::PipelineKind;
use serde::Deserialize;

use super::engine::Engine;
use super::estimator::BrakingEstimator;
use super::gear::DeclaredGear;
use super::intake::{BrakingCoefficient, BrakingIntake, IntakeSettings};
use super::motion::MotionNoise;
use super::report::ReportSettings;
use crate::pipeline::Estimator;
use crate::pipeline::motion::MOVING_MPS;
use crate::pipeline::settings::{SettingError, require};
use crate::settings;

settings! {
    /// What every braking pipeline knows beforehand of motion, measurement and braking.
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
        /// Greatest standard deviation over value of an estimate that counts.
        relative_std_max: f64 = 0.15 => (above 0);
        /// Age in s at which an estimate is stale.
        stale_after_s: f64 = 300.0 => (above 0);
    }
}

/// Standard deviation that comes in 1 s from steps of 0.2 s, uniform within a half width, each of
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

    /// The noise of motion and measurement.
    pub fn noise(&self) -> MotionNoise {
        MotionNoise {
            distance_m2_per_s: self.position_walk_m.powi(2),
            speed_m2_per_s3: self.speed_walk_mps.powi(2),
            measured_distance_m2: self.position_std_m.powi(2),
            measured_speed_m2_per_s2: self.uses_speed.then_some(self.speed_std_mps.powi(2)),
        }
    }

    fn intake(&self, quantity: BrakingCoefficient, train: &TrainModel) -> BrakingIntake {
        let settings = IntakeSettings {
            interval_s: self.interval_s,
            gap_max_s: self.gap_max_s,
            braking_min_per_weight: self.braking_min_per_weight,
            speed_min_mps: self.speed_min_mps,
            position_is_wheel_independent: self.position_is_wheel_independent,
        };
        BrakingIntake::new(quantity, settings, train)
    }

    /// The estimator of a kind around an engine.
    pub fn estimator<E: Engine + 'static>(
        &self,
        kind: PipelineKind,
        quantity: BrakingCoefficient,
        train: &TrainModel,
        engine: E,
    ) -> Box<dyn Estimator> {
        let report = ReportSettings {
            relative_std_max: self.relative_std_max,
            demand_relative_std: self.demand_relative_std,
            has_law_scale: kind == PipelineKind::AdhesionLaw,
        };
        let intake = self.intake(quantity, train);
        let sensors = (self.stale_after_s, self.position_std_m);
        Box::new(BrakingEstimator::new(kind, quantity, intake, engine, report, sensors))
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
    /// The coefficient that it is.
    pub fn quantity(self) -> BrakingCoefficient {
        match self {
            BrakeFactor::Friction => BrakingCoefficient::Friction,
            BrakeFactor::Ratio => BrakingCoefficient::Ratio,
        }
    }
}

/// Adhesion that stands for a declared one where nothing is declared.
const ADHESION_REFERENCE: f64 = 0.1;

/// The declared value of a quantity.
fn declared(quantity: BrakingCoefficient, train: &TrainModel) -> Option<f64> {
    let gear = DeclaredGear::of(&train.brake_gear);
    match quantity {
        BrakingCoefficient::Adhesion => None,
        BrakingCoefficient::Friction => gear.map(|gear| gear.friction),
        BrakingCoefficient::Ratio => gear.map(|gear| gear.ratio),
    }
}
