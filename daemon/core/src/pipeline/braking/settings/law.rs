//! Settings of the scale of a known adhesion law.

use dynocar_shared::{PipelineKind, RailCondition, Uncertain};
use serde::Deserialize;

use super::{BrakingSettings, require_positive};
use crate::pipeline::Estimator;
use crate::pipeline::braking::intake::Quantity;
use crate::pipeline::braking::law::Law;
use crate::pipeline::braking::law_bank::LawBank;
use crate::pipeline::braking::motion::Walk;
use crate::pipeline::braking::tracker::{Prior, PriorScale, TrackerModel};
use crate::pipeline::settings::SettingError;
use crate::train::TrainModel;

/// Settings of the scale of a known adhesion law.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LawSettings {
    /// Motion, measurement and braking.
    pub braking: BrakingSettings,
    /// Standard deviation of the scale of a rail's law beforehand.
    pub scale_std: f64,
    /// Standard deviation that the scale gains in 1 s.
    pub scale_walk: f64,
    /// Rate in 1/s at which the rail's condition changes.
    pub change_rate_per_s: f64,
}

impl Default for LawSettings {
    fn default() -> Self {
        LawSettings {
            braking: BrakingSettings::default(),
            scale_std: 0.25,
            scale_walk: 0.0005,
            change_rate_per_s: 0.0005,
        }
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
        require_positive("scale_std", self.scale_std)?;
        require_positive("scale_walk", self.scale_walk)?;
        require_positive("change_rate_per_s", self.change_rate_per_s)?;
        let hypothesis = |law, std| TrackerModel {
            law,
            noise: self.braking.noise(),
            walk: Walk::Scale(self.scale_walk.powi(2)),
            prior: Prior {
                speed_std_mps: self.braking.first_speed_std_mps,
                scale: PriorScale::OfLaw(Uncertain::new(1.0, std)),
            },
        };
        let hypotheses = vec![
            hypothesis(Law::Rail(RailCondition::Dry), self.scale_std),
            hypothesis(Law::Rail(RailCondition::Wet), self.scale_std),
            hypothesis(Law::Demand, self.braking.demand_relative_std),
        ];
        let bank = LawBank::new(hypotheses, self.change_rate_per_s);
        Ok(self.braking.estimator(PipelineKind::AdhesionLaw, Quantity::Adhesion, train, bank))
    }
}
