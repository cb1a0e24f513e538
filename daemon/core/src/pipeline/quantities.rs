//! Which estimators answer a controller's question for a quantity, the best measured first.

use dynocar_shared::{PipelineKind, Quantity};

use super::EstimatorSettings;
use super::braking::settings::BrakeFactor;

/// The kinds that can answer a quantity, the best measured first: the first of them that a train's
/// configuration has is the one that answers unless the configuration names another.
///
/// The order is that of `docs/scenarios.md`, then of the errors in `docs/papers.md` and of the misled
/// looks in `docs/trust.md`;
/// `docs/guides/reading.md` gives the figures.
pub const fn candidates(quantity: Quantity) -> &'static [PipelineKind] {
    use PipelineKind as Kind;
    match quantity {
        Quantity::Resistance => &[
            Kind::TrainKalman,
            Kind::TrajectoryKalman,
            Kind::ResistanceKalman,
            Kind::JointLeastSquares,
            Kind::VMils,
            Kind::Mils,
            Kind::RegularisedRls,
            Kind::Rls,
            Kind::Ls,
            Kind::TrajectoryNewton,
            Kind::StagedDescent,
        ],
        Quantity::Mass => {
            &[Kind::TrainKalman, Kind::MassKalman, Kind::JointLeastSquares, Kind::StagedDescent]
        }
        Quantity::Adhesion => {
            &[Kind::AdhesionLaw, Kind::AdhesionSmoother, Kind::AdhesionEkf, Kind::AdhesionEm]
        }
        Quantity::BrakeFriction | Quantity::BrakingRatio => {
            &[Kind::BrakeSmoother, Kind::BrakeEkf, Kind::BrakeEm]
        }
    }
}

/// One bit for each quantity that a kind can answer.
pub fn answerable(kind: PipelineKind) -> u32 {
    let can = |quantity: &&Quantity| candidates(**quantity).contains(&kind);
    Quantity::ALL.iter().filter(can).map(|quantity| quantity.bit()).sum()
}

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
