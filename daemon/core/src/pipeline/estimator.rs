//! The interface of every estimator, writing an estimate into a snapshot, and an estimator that estimates nothing.

use dynocar_model::force::ResolvedSample;
use dynocar_shared::snapshot::{PARAMETERS_MAX, packed_index};
use dynocar_shared::{
    Manoeuvre, Parameter, ParameterSnapshot, PipelineKind, Reason, RejectionReason, Status,
};
use nalgebra::{SMatrix, SVector};

use super::judge::{InputState, Judgement};
use super::{InnovationMonitor, KeptEstimate};

/// Result of an estimator's update with a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The sample shows nothing of what is learned: it waits, or the train stands.
    Idle,
    /// The sample was taken into account; the estimate stays as it was.
    Used,
    /// The sample was taken into account and the estimate was updated.
    Updated,
    /// The sample, or the window that it closed, was refused.
    Rejected(RejectionReason),
}

/// Learns parameters of the train from its samples, in order.
///
/// An implementation allocates only while it is built; time comes in with the samples, and any
/// randomness from a seed in its settings.
pub trait Estimator: Send {
    /// The kind of estimator, for the snapshot.
    fn kind(&self) -> PipelineKind;

    /// True when samples pass the gate for forces that stand alone before they are taken into account.
    fn is_gated(&self) -> bool {
        false
    }

    /// Sees every sample before the gate.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing, reads no clock.
    fn observe(&mut self, _sample: &ResolvedSample) {}

    /// Leaves a sample out that the gate refuses; the next one begins anew.
    fn leave_out(&mut self) {}

    /// Takes one sample into account.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing, reads no clock.
    fn update(&mut self, sample: &ResolvedSample) -> Outcome;

    /// Writes the estimate into a snapshot: parameters with values and covariance, excitation,
    /// innovation statistics, unexplained force, speed range; returns its judgement by the state of the input.
    /// Status and reason are written by the admission, counters and times by the pipeline.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing, reads no clock.
    fn write(&self, input: &InputState, snapshot: &mut ParameterSnapshot) -> Judgement;

    /// Takes an estimate kept from earlier as its prior, before the first sample; false when
    /// it has no use for one. The status stays unestimated until samples confirm it.
    fn warm_start(&mut self, _kept: &KeptEstimate) -> bool {
        false
    }
}

/// Counts the samples and leaves the snapshot without parameters.
#[derive(Clone, Copy, Debug, Default)]
pub struct Echo;

impl Estimator for Echo {
    fn kind(&self) -> PipelineKind {
        PipelineKind::Echo
    }

    fn update(&mut self, _sample: &ResolvedSample) -> Outcome {
        Outcome::Used
    }

    fn write(&self, _input: &InputState, _snapshot: &mut ParameterSnapshot) -> Judgement {
        (Status::Unestimated, Reason::None).into()
    }
}

/// A parameter's unit in the contract over the one that estimators compute in: a snapshot has the
/// mass in t, everything here has it in kg.
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
