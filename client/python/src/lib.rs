//! The native half of the Python package `dynocar`, its module `dynocar._native`. Users import the half that is written
//! in Python (`dynocar/`).
//!
//! # Layout
//!
//! - [`channel`]: publisher and reader, each kept in the thread that opened it
//! - [`snapshot`]: results of a reader; braking distance and time with a bound
//! - [`about`]: clock, versions, who serves a train, vocabularies
//! - [`calls`]: failures as the exceptions of `dynocar/_errors.py`; long work that Ctrl-C ends
//! - [`recorded`]: `check`, `read`, `identify`, `explain`; columns for NumPy, tables for Arrow

mod about;
mod calls;
mod channel;
mod recorded;
mod snapshot;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::about::{
        daemon_state, effect_words, layouts, monotonic_now_ns, parameter_unit, parameter_words,
        version, vocabularies,
    };
    #[pymodule_export]
    use crate::channel::{Publisher, Reader};
    #[pymodule_export]
    use crate::recorded::{Column, Table};
    #[pymodule_export]
    use crate::recorded::{Explained, explain};
    #[pymodule_export]
    use crate::recorded::{check, identify, read};
    #[pymodule_export]
    use crate::snapshot::stopping_estimate;
    #[pymodule_export]
    use crate::snapshot::{ParameterSnapshot, Reading, dtypes};
}
