//! Failures as the exceptions of `dynocar/_errors.py`, in the words of the command line.

use dynocar::cli::Failure;
use dynocar_client::ChannelError;
use dynocar_client::ffi::Code;
use pyo3::call::PyCallArgs;
use pyo3::prelude::*;

/// An exception of a class of `dynocar/_errors.py`.
fn raised<'py>(py: Python<'py>, class: &str, arguments: impl PyCallArgs<'py>) -> PyErr {
    let class = py.import("dynocar._errors").and_then(|module| module.getattr(class));
    match class.and_then(|class| class.call1(arguments)) {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

/// A code of the interface, in its own words.
pub(crate) fn of_code(py: Python<'_>, code: Code) -> PyErr {
    raised(py, "ChannelError", (code.text().to_string_lossy(), code as i32))
}

/// A channel that cannot be opened or used.
pub(crate) fn of_channel(py: Python<'_>, error: &ChannelError) -> PyErr {
    raised(py, "ChannelError", (error.to_string(), Code::from(error) as i32))
}

/// A command that ended without its result.
pub(crate) fn of_failure(py: Python<'_>, failure: &Failure) -> PyErr {
    match failure.answer() {
        Some(it) if it.exit_status == 2 => raised(py, "InputError", (it.message, it.file, it.line)),
        Some(it) => raised(py, "WorkError", (it.message,)),
        None => raised(py, "WorkError", ("the result is bad news, reported already",)),
    }
}
