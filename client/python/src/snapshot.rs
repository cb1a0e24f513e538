//! Results of a reader, and braking distance and time by the law of `dynocar_shared::stopping`, with the arguments of
//! the C interface.

use dynocar_client::ffi::{Code, ReadingCopy, StopRequest};
use dynocar_shared::RailAdhesion;
use dynocar_shared::schema::{Field, sample_fields, snapshot_fields};
use dynocar_shared::stopping::EffortPoint;
use pyo3::exceptions::PyAttributeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyList};

use crate::calls::of_code;

/// A snapshot with its age, or the code that tells why there is no snapshot.
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
    fn use_state(&self) -> u32 {
        self.copy.use_state() as u32
    }

    /// Returns the reason for the state of use.
    #[getter]
    fn why(&self) -> &'static str {
        self.copy.why()
    }

    #[getter]
    fn snapshot(&self) -> ParameterSnapshot {
        ParameterSnapshot(self.copy.snapshot)
    }
}

/// w0, its standard deviation, the force, its, and whether the speed was driven.
type Resistance = (f64, f64, f64, f64, bool);

/// Every field of `dynocar_parameter_snapshot` in `dynocar.h`, under its name there.
#[pyclass(frozen, module = "dynocar._native")]
pub(crate) struct ParameterSnapshot(dynocar_shared::ParameterSnapshot);

#[pymethods]
impl ParameterSnapshot {
    /// Returns a field by its name: a number, or a list of them.
    fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let field = snapshot_fields().find(|it| it.layout.name == name).ok_or_else(|| {
            PyAttributeError::new_err(format!("'ParameterSnapshot' has no field '{name}'"))
        })?;
        let entries = self.0.fields()[field.index];
        let mut numbers = (0..entries.count()).map(|index| number(py, &field, entries.word(index)));
        if field.is_array() {
            return Ok(PyList::new(py, numbers.collect::<PyResult<Vec<_>>>()?)?.into_any());
        }
        numbers.next().unwrap_or_else(|| Ok(py.None().into_bound(py)))
    }

    fn __dir__(&self) -> Vec<&'static str> {
        snapshot_fields()
            .map(|it| it.layout.name)
            .chain(["learned_rail", "resistance_at"])
            .collect()
    }

    /// Scale of the wet rail's law, and its standard deviation; `None` without adhesion.
    fn learned_rail(&self) -> Option<(f64, f64)> {
        match RailAdhesion::learned(&self.0)? {
            RailAdhesion::Law(_, scale) => Some((scale.value, scale.std)),
            _ => None,
        }
    }

    /// Returns the bytes as they lie in shared memory, which `numpy.frombuffer` reads by `SNAPSHOT_DTYPE`.
    fn __bytes__<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let mut bytes = Vec::with_capacity(size_of_val(&self.0));
        for field in snapshot_fields() {
            let (entries, size) =
                (self.0.fields()[field.index], field.layout.size / field.entries());
            for index in 0..entries.count() {
                let word = entries.word(index);
                match cfg!(target_endian = "little") {
                    true => bytes.extend(&word.to_le_bytes()[..size]),
                    false => bytes.extend(&word.to_be_bytes()[8 - size..]),
                }
            }
        }
        PyBytes::new(py, &bytes)
    }

    /// w0 and its standard deviation in N/kN, the force and its in N, whether the speed lies
    /// outside those driven; `None` without a, b and c.
    fn resistance_at(
        &self,
        py: Python<'_>,
        speed_mps: f64,
        mass_kg: f64,
    ) -> PyResult<Option<Resistance>> {
        if !(speed_mps.is_finite() && mass_kg.is_finite() && mass_kg >= 0.0) {
            return Err(of_code(py, Code::BadNumber));
        }
        Ok(self.0.resistance_at(speed_mps).map(|it| {
            let (force_n, force_std_n) = it.force_n(mass_kg);
            (it.w0_n_per_kn, it.w0_std_n_per_kn, force_n, force_std_n, it.is_extrapolated)
        }))
    }
}

fn number<'py>(py: Python<'py>, field: &Field, word: u64) -> PyResult<Bound<'py, PyAny>> {
    Ok(match field.entry_type() {
        "f64" => f64::from_bits(word).into_pyobject(py)?.into_any(),
        "i64" | "i8" => (word as i64).into_pyobject(py)?.into_any(),
        _ => word.into_pyobject(py)?.into_any(),
    })
}

/// Names, types in NumPy's notation and offsets of a struct's fields, and its size.
type Dtype = (Vec<&'static str>, Vec<String>, Vec<usize>, usize);

fn dtype(fields: impl Iterator<Item = Field>, size: usize) -> Dtype {
    let mut dtype: Dtype = (Vec::new(), Vec::new(), Vec::new(), size);
    for field in fields {
        let shape =
            if field.is_array() { format!("({},)", field.entries()) } else { String::new() };
        dtype.0.push(field.layout.name);
        dtype.1.push(shape + &field.numpy_type());
        dtype.2.push(field.layout.offset);
    }
    dtype
}

/// Returns the NumPy types of samples and snapshots as they lie in shared memory.
#[pyfunction]
pub(crate) fn dtypes() -> (Dtype, Dtype) {
    use dynocar_shared::{ParameterSnapshot, TrainSample};
    (
        dtype(sample_fields(), size_of::<TrainSample>()),
        dtype(snapshot_fields(), size_of::<ParameterSnapshot>()),
    )
}

/// Returns distance, time, and both with the confidence. `numbers` are the members of `dynocar_stop` in `dynocar.h`
/// before `rail`.
#[pyfunction]
pub(crate) fn stopping_estimate(
    py: Python<'_>,
    numbers: [f64; 18],
    rail: u64,
    effort: Vec<(f64, f64)>,
    confidence: f64,
) -> PyResult<(f64, f64, f64, f64)> {
    let mut request = StopRequest { rail, ..StopRequest::default() };
    for (member, number) in request.fields_mut().into_iter().zip(numbers) {
        member.set_word(0, number.to_bits());
    }
    let effort: Vec<EffortPoint> =
        effort.into_iter().map(|(speed_mps, force_n)| EffortPoint { speed_mps, force_n }).collect();
    let found = request.estimate(&effort, confidence).map_err(|code| of_code(py, code))?;
    Ok((found.distance_m, found.time_s, found.distance_bound_m, found.time_bound_s))
}
