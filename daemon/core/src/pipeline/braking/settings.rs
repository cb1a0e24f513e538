//! Settings of the braking pipelines and of the fixed-lag smoother, and how each pipeline is built from them.

use dynocar_model::train::TrainModel;
use dynocar_shared::{PipelineKind, RailCondition, Uncertain};
use serde::Deserialize;

pub use super::engine::BrakingSettings;
use super::intake::{BrakingCoefficient, DeclaredGear};
use super::law::{BrakingLaw, SpeedTable};
use super::law_bank::LawBank;
use super::motion::Walk;
use super::tracker::{PriorScale, Tracker, TrackerModel};
use crate::pipeline::Estimator;
use crate::pipeline::settings::SettingError;
use crate::{check_setting, settings};

/// The factor of the brake force that a brake pipeline reports; the other factor is held as declared, since only their
/// product acts on the train.
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
    /// Returns the coefficient of this factor.
    pub fn quantity(self) -> BrakingCoefficient {
        match self {
            BrakeFactor::Friction => BrakingCoefficient::Friction,
            BrakeFactor::Ratio => BrakingCoefficient::Ratio,
        }
    }
}

/// Adhesion that stands for a declared one where nothing is declared.
const ADHESION_REFERENCE: f64 = 0.1;

/// Returns the declared value of a quantity.
fn declared(quantity: BrakingCoefficient, train: &TrainModel) -> Option<f64> {
    let gear = DeclaredGear::from_gear(&train.brake_gear);
    match quantity {
        BrakingCoefficient::Adhesion => None,
        BrakingCoefficient::Friction => gear.map(|gear| gear.friction),
        BrakingCoefficient::Ratio => gear.map(|gear| gear.ratio),
    }
}

settings! {
    /// Settings of the extended Kalman filter with a random walk of the coefficient.
    #[derive(Copy)]
    EkfSettings {
        /// Motion, measurement and braking.
        braking: BrakingSettings = BrakingSettings::default();
        /// The coefficient before the first observation; the declared one, or an adhesion of 0.1, when
        /// absent.
        initial: Option<f64> = None => (0 or more);
        /// Standard deviation of `initial` over the declared value (over 0.1 for adhesion).
        initial_relative_std: f64 = 1.0 => (above 0);
        /// Standard deviation that the coefficient gains in 1 s, over the demand; when absent, the value that serves
        /// best in the papers' scenarios.
        relative_walk: Option<f64> = None => (above 0);
        /// Factor that a brake pipeline reports; no meaning for adhesion.
        reports: BrakeFactor = BrakeFactor::Friction;
    }
}

impl EkfSettings {
    /// Builds an estimator of a kind.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn build(
        &self,
        kind: PipelineKind,
        quantity: BrakingCoefficient,
        train: &TrainModel,
    ) -> Result<Box<dyn Estimator>, SettingError> {
        self.braking.check()?;
        self.check_ranges()?;
        let relative_walk = self.relative_walk.unwrap_or(match quantity {
            BrakingCoefficient::Adhesion => 0.018,
            BrakingCoefficient::Friction => 0.03,
            BrakingCoefficient::Ratio => 0.004,
        });
        let reference = declared(quantity, train).unwrap_or(ADHESION_REFERENCE);
        let initial_std = self.initial_relative_std * reference;
        let initial = Uncertain::new(self.initial.unwrap_or(reference), initial_std);
        let walk = Walk::Scale(relative_walk.powi(2));
        let prior = PriorScale::OfCoefficient(initial);
        let model = TrackerModel::new(&self.braking, BrakingLaw::Demand, walk, prior);
        Ok(self.braking.estimator(kind, quantity, train, Tracker::new(model, 0.0, 0, false)))
    }
}

settings! {
    /// Settings of the scale of a known adhesion law.
    #[derive(Copy)]
    LawSettings {
        /// Motion, measurement and braking.
        braking: BrakingSettings = BrakingSettings::default();
        /// Standard deviation of the scale of a rail's law beforehand.
        scale_std: f64 = 0.25 => (above 0);
        /// Standard deviation that the scale gains in 1 s.
        scale_walk: f64 = 0.0005 => (above 0);
        /// Rate in 1/s at which the rail's condition changes.
        change_rate_per_s: f64 = 0.0005 => (above 0);
    }
}

impl LawSettings {
    /// Builds `adhesion_law`.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn build_adhesion(&self, train: &TrainModel) -> Result<Box<dyn Estimator>, SettingError> {
        self.braking.check()?;
        self.check_ranges()?;
        let walk = Walk::Scale(self.scale_walk.powi(2));
        let hypothesis = |law, std| {
            let prior = PriorScale::OfLaw(Uncertain::new(1.0, std));
            TrackerModel::new(&self.braking, law, walk, prior)
        };
        let hypotheses = [
            hypothesis(BrakingLaw::Rail(RailCondition::Dry), self.scale_std),
            hypothesis(BrakingLaw::Rail(RailCondition::Wet), self.scale_std),
            hypothesis(BrakingLaw::Demand, self.braking.demand_relative_std),
        ];
        let bank = LawBank::new(hypotheses, self.change_rate_per_s);
        let (kind, quantity) = (PipelineKind::AdhesionLaw, BrakingCoefficient::Adhesion);
        Ok(self.braking.estimator(kind, quantity, train, bank))
    }
}

/// How the achieved share of the declared brake force wanders.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum WalkSettings {
    /// It drifts, and the drift comes and goes.
    Drift {
        /// Standard deviation of the drift in 1/s.
        std_per_s: f64,
        /// Time in s after which the drift is forgotten.
        time_s: f64,
    },
    /// It walks at random.
    Scale {
        /// Standard deviation that it gains in 1 s.
        std_after_1_s: f64,
    },
}

settings! {
    /// Settings of the fixed-lag smoother.
    SmootherSettings {
        /// Motion, measurement and braking.
        braking: BrakingSettings = BrakingSettings::default();
        /// The estimate lies this many seconds back; 0 for the present.
        lag_s: f64 = 5.0 => (0 to 60);
        /// How the achieved share of the declared brake force wanders; see [`WalkSettings`], and
        /// `SmootherSettings::walk` for the walk that holds when this one is absent.
        walk: Option<WalkSettings> = None;
        /// Factor that a brake pipeline reports; no meaning for adhesion.
        reports: BrakeFactor = BrakeFactor::Friction;
        /// A known curve of disc friction, [speed in m/s, friction]; only its scale is estimated.
        friction_law: Option<Vec<(f64, f64)>> = None;
    }
}

/// The share beforehand: anything from none of the declared force to three times as much. It is
/// wide enough to be forgotten within seconds, and no setting moves it.
const SHARE_PRIOR: Uncertain = Uncertain::new(1.0, 1.0);

impl SmootherSettings {
    /// Returns how the share wanders.
    ///
    /// Unless set: adhesion drifts as both rail laws do at full braking, by about half a percent
    /// of the demand per second in one direction throughout; disc friction drifts faster and by
    /// turns; a braking ratio, and the scale of a known friction curve, hardly move.
    pub fn walk(&self, quantity: BrakingCoefficient) -> WalkSettings {
        self.walk.unwrap_or(match quantity {
            BrakingCoefficient::Adhesion => WalkSettings::Drift { std_per_s: 0.005, time_s: 120.0 },
            BrakingCoefficient::Friction if self.friction_law.is_some() => {
                WalkSettings::Scale { std_after_1_s: 0.0005 }
            }
            BrakingCoefficient::Friction => WalkSettings::Drift { std_per_s: 0.012, time_s: 5.0 },
            BrakingCoefficient::Ratio => WalkSettings::Scale { std_after_1_s: 0.004 },
        })
    }

    fn checked_walk(&self, quantity: BrakingCoefficient) -> Result<Walk, SettingError> {
        match self.walk(quantity) {
            WalkSettings::Drift { std_per_s, time_s } => {
                check_setting!(std_per_s, "walk.std_per_s", (above 0));
                check_setting!(time_s, "walk.time_s", (above 0));
                Ok(Walk::Drift { std_per_s, time_s })
            }
            WalkSettings::Scale { std_after_1_s } => {
                check_setting!(std_after_1_s, "walk.std_after_1_s", (above 0));
                Ok(Walk::Scale(std_after_1_s.powi(2)))
            }
        }
    }

    fn law(&self, quantity: BrakingCoefficient) -> Result<BrakingLaw, SettingError> {
        match (&self.friction_law, quantity) {
            (Some(points), BrakingCoefficient::Friction) => {
                SpeedTable::new(points.clone()).map(BrakingLaw::Table).map_err(|_| SettingError {
                    key: "friction_law",
                    value: points.len() as f64,
                    allowed: "two or more [speed, friction], speeds rising, friction above 0",
                })
            }
            (Some(points), _) => Err(SettingError {
                key: "friction_law",
                value: points.len() as f64,
                allowed: "a curve only where disc friction is reported",
            }),
            (None, _) => Ok(BrakingLaw::Demand),
        }
    }

    /// Builds an estimator of a kind.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn build(
        &self,
        kind: PipelineKind,
        quantity: BrakingCoefficient,
        train: &TrainModel,
    ) -> Result<Box<dyn Estimator>, SettingError> {
        self.braking.check()?;
        self.check_ranges()?;
        let (law, walk) = (self.law(quantity)?, self.checked_walk(quantity)?);
        let model = TrackerModel::new(&self.braking, law, walk, PriorScale::OfLaw(SHARE_PRIOR));
        let most_moments = (self.lag_s / (0.9 * self.braking.interval_s)).ceil() as usize;
        let tracker = Tracker::new(model, self.lag_s, most_moments, true);
        Ok(self.braking.estimator(kind, quantity, train, tracker))
    }
}
