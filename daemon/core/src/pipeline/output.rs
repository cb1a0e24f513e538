//! Output of an estimator: the quantities that its kind can answer, and its estimate in a snapshot.

use dynocar_shared::snapshot::{PARAMETERS_MAX, packed_index};
use dynocar_shared::{Manoeuvre, Parameter, ParameterSnapshot, PipelineKind, Quantity};
use nalgebra::{SMatrix, SVector};

use super::InnovationMonitor;

/// Returns the unit of a parameter in a snapshot over the unit that estimators compute in: a snapshot has the mass in
/// t, the estimators have it in kg.
pub fn contract_unit(parameter: Parameter) -> f64 {
    if parameter == Parameter::Mass { 1e-3 } else { 1.0 }
}

/// Writes parameters with values and full covariance, the mass in kg.
///
/// # Panics
///
/// At compile time when there are more parameters than a snapshot holds.
pub fn write_parameters<const N: usize>(
    snapshot: &mut ParameterSnapshot,
    parameters: [Parameter; N],
    values: &SVector<f64, N>,
    covariance: &SMatrix<f64, N, N>,
) {
    const { assert!(N <= PARAMETERS_MAX) };
    snapshot.parameter_count = N as u32;
    let units = parameters.map(contract_unit);
    for i in 0..N {
        snapshot.parameters[i] = parameters[i] as u32;
        snapshot.values[i] = units[i] * values[i];
        for j in 0..=i {
            snapshot.covariance[packed_index(i, j)] = units[i] * units[j] * covariance[(i, j)];
        }
    }
}

/// Writes the innovation statistics.
pub fn write_innovations(snapshot: &mut ParameterSnapshot, monitor: &InnovationMonitor) {
    snapshot.innovation_normalised = monitor.last();
    snapshot.innovation_mean_square = monitor.mean_square();
    snapshot.innovation_correlation = monitor.correlation();
}

/// The Davis coefficients, in their order.
pub const DAVIS: [Parameter; 3] = [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC];
/// The Davis coefficients and the mass, in their order.
pub const DAVIS_AND_MASS: [Parameter; 4] =
    [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC, Parameter::Mass];
/// Manoeuvre that brings data for each of them.
const MANOEUVRES: [Manoeuvre; 4] =
    [Manoeuvre::CoastSlow, Manoeuvre::VarySpeed, Manoeuvre::CoastFast, Manoeuvre::Accelerate];

/// Bits of those of [`DAVIS_AND_MASS`] that the data determine, and of the manoeuvres that bring data
/// for the others.
pub fn excitation<const N: usize>(is_known: [bool; N]) -> (u32, u32) {
    let mut bits = (0, 0);
    for (i, (is_known, manoeuvre)) in is_known.into_iter().zip(MANOEUVRES).enumerate() {
        match is_known {
            true => bits.0 |= 1 << i,
            false => bits.1 |= manoeuvre.bit(),
        }
    }
    bits
}

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
