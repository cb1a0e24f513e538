//! Settings of the braking pipelines, and how each is built from them.

use dynocar_model::train::TrainModel;
use dynocar_shared::{PipelineKind, RailCondition, Uncertain};
use serde::Deserialize;

use super::intake::{BrakingCoefficient, DeclaredGear};
use super::law::BrakingLaw;
use super::law_bank::LawBank;
use super::motion::Walk;
use super::tracker::{PriorScale, Tracker, TrackerModel};
use crate::pipeline::Estimator;
use crate::pipeline::settings::SettingError;
use crate::settings;

pub use super::engine::BrakingSettings;
pub use smoother::{SmootherSettings, WalkSettings};

mod smoother;

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

settings! {
    /// Settings of the extended Kalman filter with a random walk of the coefficient.
    #[derive(Copy)]
    EkfSettings {
        /// Motion, measurement and braking.
        braking: BrakingSettings = BrakingSettings::default();
        /// The coefficient before the first observation; the declared one, or an adhesion of 0.1, when
        /// absent.
        initial: Option<f64> = None => (0 or more);
        /// Its standard deviation over the declared value (over 0.1 for adhesion).
        initial_relative_std: f64 = 1.0 => (above 0);
        /// Standard deviation that it gains in 1 s, over the demand; when absent, what serves best in
        /// the papers' scenarios.
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
