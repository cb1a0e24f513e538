//! Settings of the extended Kalman filter.

use dynocar_model::train::TrainModel;
use dynocar_shared::{PipelineKind, Uncertain};

use super::{ADHESION_REFERENCE, BrakeFactor, BrakingSettings, declared};
use crate::pipeline::Estimator;
use crate::pipeline::braking::intake::BrakingCoefficient;
use crate::pipeline::braking::law::Law;
use crate::pipeline::braking::motion::Walk;
use crate::pipeline::braking::tracker::{Prior, PriorScale, Tracker, TrackerModel};
use crate::pipeline::settings::SettingError;
use crate::settings;

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
        /// What a brake pipeline reports; no meaning for adhesion.
        reports: BrakeFactor = BrakeFactor::Friction;
    }
}

impl EkfSettings {
    fn relative_walk(&self, quantity: BrakingCoefficient) -> f64 {
        self.relative_walk.unwrap_or(match quantity {
            BrakingCoefficient::Adhesion => 0.018,
            BrakingCoefficient::Friction => 0.03,
            BrakingCoefficient::Ratio => 0.004,
        })
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
        let relative_walk = self.relative_walk(quantity);
        let reference = declared(quantity, train).unwrap_or(ADHESION_REFERENCE);
        let initial_std = self.initial_relative_std * reference;
        let initial = self.initial.unwrap_or(reference);
        let model = TrackerModel {
            law: Law::Demand,
            noise: self.braking.noise(),
            walk: Walk::Scale(relative_walk.powi(2)),
            prior: Prior {
                speed_std_mps: self.braking.first_speed_std_mps,
                scale: PriorScale::OfCoefficient(Uncertain::new(initial, initial_std)),
            },
        };
        Ok(self.braking.estimator(kind, quantity, train, Tracker::new(model, 0.0, 0, false)))
    }
}
