//! What a reader gives.

use dynocar_client::ffi::{Code, ReadingCopy};
use dynocar_shared::snapshot::{COVARIANCE_ENTRIES, PARAMETERS_MAX, REJECTION_REASONS};
use pyo3::prelude::*;

use crate::errors::of_code;

/// A snapshot with its age, or the code that says why there is none.
#[pyclass(frozen, module = "dynocar._native")]
pub(crate) struct Reading {
    pub(crate) code: Code,
    pub(crate) copy: ReadingCopy,
}

#[pymethods]
impl Reading {
    #[getter]
    fn code(&self) -> i32 {
        self.code as i32
    }

    #[getter]
    fn age_ns(&self) -> i64 {
        self.copy.age_ns
    }

    #[getter]
    fn status(&self) -> u32 {
        self.copy.status
    }

    #[getter]
    fn reason(&self) -> u32 {
        self.copy.reason
    }

    #[getter]
    fn is_stale(&self) -> bool {
        self.copy.is_stale != 0
    }

    #[getter]
    fn is_usable(&self) -> bool {
        self.copy.is_usable != 0
    }

    #[getter]
    fn snapshot(&self) -> ParameterSnapshot {
        ParameterSnapshot(self.copy.snapshot)
    }
}

/// Every field of `dynocar_parameter_snapshot` in `dynocar.h`, under its name there.
#[pyclass(frozen, module = "dynocar._native")]
pub(crate) struct ParameterSnapshot(dynocar_shared::ParameterSnapshot);

/// Gives Python the fields, and the function that it asks of a snapshot.
macro_rules! fields {
    ($( $field:ident: $kind:ty ),* $(,)?) => {
        #[pymethods]
        impl ParameterSnapshot {
            $(
                #[getter]
                fn $field(&self) -> $kind {
                    self.0.$field
                }
            )*

            /// w0 and its standard deviation in N/kN, the force and its in N, whether the speed lies
            /// outside those driven; `None` without a, b and c.
            fn resistance_at(
                &self,
                py: Python<'_>,
                speed_mps: f64,
                mass_kg: f64,
            ) -> PyResult<Option<(f64, f64, f64, f64, bool)>> {
                if !(speed_mps.is_finite() && mass_kg.is_finite() && mass_kg >= 0.0) {
                    return Err(of_code(py, Code::BadNumber));
                }
                Ok(self.0.resistance_at(speed_mps).map(|it| {
                    let (force_n, force_std_n) = it.force_n(mass_kg);
                    (it.w0_n_per_kn, it.w0_std_n_per_kn, force_n, force_std_n, it.is_extrapolated)
                }))
            }
        }
    };
}

fields! {
    epoch: u64,
    sequence: u64,
    generation: u64,
    train_id: u64,
    pipeline_index: u32,
    pipeline_kind: u32,
    status: u32,
    reason: u32,
    quantities: u32,
    train_quantities: u32,
    sample_time_ns: i64,
    sample_published_ns: i64,
    published_ns: i64,
    vouched_ns: i64,
    sample_sequence: u64,
    samples_used: u64,
    samples_rejected: u64,
    samples_lost: u64,
    updates: u64,
    rejected_by_reason: [u32; REJECTION_REASONS],
    parameter_count: u32,
    excited: u32,
    missing_manoeuvres: u32,
    suspected_effect: u32,
    suspected_alternatives: u32,
    suspicion_age_s: u32,
    parameters: [u32; PARAMETERS_MAX],
    values: [f64; PARAMETERS_MAX],
    covariance: [f64; COVARIANCE_ENTRIES],
    innovation_normalised: f64,
    innovation_mean_square: f64,
    innovation_correlation: f64,
    unexplained_force_n: f64,
    unexplained_force_std_n: f64,
    suspicion_evidence: f64,
    speed_min_mps: f64,
    speed_max_mps: f64,
}
