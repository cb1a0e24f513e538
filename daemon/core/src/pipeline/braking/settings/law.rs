//! Settings of the scale of a known adhesion law.

use dynocar_model::train::TrainModel;
use dynocar_shared::{PipelineKind, RailCondition, Uncertain};

use super::BrakingSettings;
use crate::pipeline::Estimator;
use crate::pipeline::braking::intake::BrakingCoefficient;
use crate::pipeline::braking::law::Law;
use crate::pipeline::braking::law_bank::LawBank;
use crate::pipeline::braking::motion::Walk;
use crate::pipeline::braking::tracker::{Prior, PriorScale, TrackerModel};
use crate::pipeline::settings::SettingError;
use crate::settings;

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
        let hypothesis = |law, std| TrackerModel {
            law,
            noise: self.braking.noise(),
            walk: Walk::Scale(self.scale_walk.powi(2)),
            prior: Prior {
                speed_std_mps: self.braking.first_speed_std_mps,
                scale: PriorScale::OfLaw(Uncertain::new(1.0, std)),
            },
        };
        let hypotheses = [
            hypothesis(Law::Rail(RailCondition::Dry), self.scale_std),
            hypothesis(Law::Rail(RailCondition::Wet), self.scale_std),
            hypothesis(Law::Demand, self.braking.demand_relative_std),
        ];
        let bank = LawBank::new(hypotheses, self.change_rate_per_s);
        Ok(self.braking.estimator(
            PipelineKind::AdhesionLaw,
            BrakingCoefficient::Adhesion,
            train,
            bank,
        ))
    }
}
