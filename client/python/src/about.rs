//! Clock, versions, who serves a train, the words of answers, and the vocabularies against which the tests check those
//! in Python.

use std::fmt::Debug;
use std::path::PathBuf;

use dynocar_client::Host;
use dynocar_client::ffi::about::{DaemonState, state_of_daemon};
use dynocar_client::ffi::{Code, Rail};
use dynocar_model::words;
use dynocar_shared::schema::unit_of;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{
    Manoeuvre, Parameter, ParameterSnapshot, PipelineKind, Quantity, Reason, RejectionReason,
    SCHEMA_MAJOR, SampleField, Status, TrainId, TrainSample,
};
use pyo3::prelude::*;

use crate::calls::of_channel;

/// Returns who serves a train, as a number and in words.
#[pyfunction]
pub(crate) fn daemon_state(
    py: Python<'_>,
    train_id: u64,
    root: Option<PathBuf>,
) -> PyResult<(i32, String)> {
    let looked_up = py.detach(move || {
        let host = Host::of(root.as_deref())?;
        state_of_daemon(&host, TrainId(train_id))
    });
    let (state, words) = looked_up.map_err(|error| of_channel(py, &error))?;
    Ok((state as i32, words))
}

/// Returns the host's monotonic clock in ns.
#[pyfunction]
pub(crate) fn monotonic_now_ns() -> i64 {
    dynocar_client::monotonic_now_ns()
}

/// Returns the release.
#[pyfunction]
pub(crate) fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}

/// Returns the unit of a parameter's value; empty where it has none, or where the parameter is not known.
#[pyfunction]
pub(crate) fn parameter_unit(number: u32) -> &'static str {
    Parameter::from_number(number).map_or("", |it| unit_of(it.full_name()))
}

/// The words for a kind of effect, and for the stretches of the line where it acts.
#[pyfunction]
pub(crate) fn effect_words(kind: &str, intervals_m: Vec<[f64; 2]>) -> (String, String) {
    (words::kind_name(kind).into(), words::stretches(&intervals_m))
}

/// Returns the meaning of an effect's parameter.
#[pyfunction]
pub(crate) fn parameter_words(name: &str) -> &str {
    words::parameter(name).0
}

/// Schema major of the channels, layout hashes of sample and snapshot.
#[pyfunction]
pub(crate) fn layouts() -> (u32, u64, u64) {
    (SCHEMA_MAJOR, TrainSample::LAYOUT_HASH, ParameterSnapshot::LAYOUT_HASH)
}

/// The members of a vocabulary: their names as in Rust, and their numbers.
type Members = Vec<(String, i64)>;

/// Returns every vocabulary with its members.
#[pyfunction]
pub(crate) fn vocabularies() -> Vec<(&'static str, Members)> {
    fn members<V: Debug + Copy>(all: &[V], number: impl Fn(V) -> i64) -> Members {
        all.iter().map(|&member| (format!("{member:?}"), number(member))).collect()
    }
    vec![
        ("Code", members(Code::ALL, |it| it as i64)),
        ("Rail", members(Rail::ALL, |it| it as i64)),
        ("DaemonState", members(DaemonState::ALL, |it| it as i64)),
        ("Status", members(Status::ALL, |it| it as i64)),
        ("Reason", members(Reason::ALL, |it| it as i64)),
        ("PipelineKind", members(PipelineKind::ALL, |it| it as i64)),
        ("Quantity", members(Quantity::ALL, |it| it as i64)),
        ("Parameter", members(Parameter::ALL, |it| it as i64)),
        ("RejectionReason", members(RejectionReason::ALL, |it| it as i64)),
        ("Manoeuvre", members(Manoeuvre::ALL, |it| i64::from(it.bit()))),
        ("Effect", members(EffectKind::ALL, |it| it as i64)),
        ("Has", members(&SampleField::ALL, |it| i64::from(it.bit()))),
    ]
}
