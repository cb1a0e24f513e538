//! Which quantities an estimator gives, as it is set.

use dynocar_core::pipeline::braking::settings::BrakeFactor;
use dynocar_core::pipeline::quantities::candidates;
#[cfg(test)]
use dynocar_shared::PipelineKind;
use dynocar_shared::Quantity;

use crate::EstimatorSettings;

impl EstimatorSettings {
    /// True when the estimator, so set, gives what a controller asks for.
    pub fn answers(&self, quantity: Quantity) -> bool {
        let reports = match self {
            EstimatorSettings::BrakeSmoother(settings) => Some(settings.reports),
            EstimatorSettings::BrakeEkf(settings) => Some(settings.reports),
            EstimatorSettings::BrakeEm(settings) => Some(settings.reports),
            _ => None,
        };
        candidates(quantity).contains(&self.kind())
            && match quantity {
                Quantity::BrakeFriction => reports == Some(BrakeFactor::Friction),
                Quantity::BrakingRatio => reports == Some(BrakeFactor::Ratio),
                _ => true,
            }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers come from the estimator alone, so that a kind which never writes a quantity's
    /// parameters cannot answer it.
    #[test]
    fn every_kind_but_monitor_and_echo_answers_something() {
        for &kind in PipelineKind::ALL {
            let settings = EstimatorSettings::default_of(kind).expect("every kind can be built");
            let answers = Quantity::ALL.iter().filter(|&&it| settings.answers(it)).count();
            let is_silent = matches!(kind, PipelineKind::ResidualMonitor | PipelineKind::Echo);
            assert_eq!(answers == 0, is_silent, "{kind}");
        }
    }

    #[test]
    fn a_brake_pipeline_answers_for_the_factor_that_it_reports() {
        let set = |reports| {
            let table = format!("kind = \"brake_smoother\"\nreports = \"{reports}\"");
            toml::from_str::<EstimatorSettings>(&table).unwrap()
        };
        let answered = |settings: EstimatorSettings| {
            Quantity::ALL.iter().copied().filter(|&it| settings.answers(it)).collect::<Vec<_>>()
        };
        assert_eq!(answered(set("friction")), [Quantity::BrakeFriction]);
        assert_eq!(answered(set("ratio")), [Quantity::BrakingRatio]);
    }
}
