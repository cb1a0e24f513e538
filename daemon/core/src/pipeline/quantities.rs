//! The estimators that answer a controller's question for a quantity, the best measured first.

use dynocar_shared::{PipelineKind, Quantity};

/// Returns the kinds that can answer a quantity, the best measured first: unless the configuration names another, the
/// first kind that the train has answers.
///
/// The order is that of `docs/scenarios.md`, then of the errors in `docs/papers.md` and of the share of misleading
/// snapshots in `docs/trust.md`; `docs/guides/reading.md` gives the figures.
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
