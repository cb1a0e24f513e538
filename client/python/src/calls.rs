//! Calls from Python: failures become the exceptions of `dynocar/_errors.py`, in the words of the command line; long work
//! leaves the lock of Python's interpreter free, reports progress in the caller's thread, and ends by a signal (Ctrl-C).

use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use dynocar::cli::Failure;
use dynocar_client::ChannelError;
use dynocar_client::ffi::Code;
use pyo3::call::PyCallArgs;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Time between two checks for signals.
pub(crate) const SIGNALS_EVERY: Duration = Duration::from_millis(50);

/// Called with the share done, 0 to 1, and the name of the present step.
pub(crate) type Progress<'p> = &'p (dyn Fn(f64, &str) + Sync);

/// Does the work in a thread of its own and calls `progress` with its steps. When a signal or `progress` raises, the
/// caller gets that exception at once, and the work ends at its next step.
pub(crate) fn in_background<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(Progress<'_>) -> T + Send + 'static,
) -> PyResult<T> {
    let is_given_up = Arc::new(AtomicBool::new(false));
    let (sender, mut steps) = channel();
    let is_unwanted = Arc::clone(&is_given_up);
    // Threads of this call: those of an earlier one are not there in a forked child.
    let threads = rayon::ThreadPoolBuilder::new().build();
    let threads = threads.map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
    let worker = std::thread::spawn(move || {
        let progress = move |share: f64, what: &str| {
            if is_unwanted.load(Ordering::Relaxed) {
                resume_unwind(Box::new("given up"));
            }
            // Fails only when the work was given up this moment.
            let _ = sender.send((share, what.replace('_', " ")));
        };
        threads.install(|| work(&progress))
    });
    loop {
        let (step, back) = py.detach(move || (steps.recv_timeout(SIGNALS_EVERY), steps));
        steps = back;
        let outcome = match (step, progress) {
            (Err(RecvTimeoutError::Disconnected), _) => break,
            (Ok((share, what)), Some(progress)) => progress.call1((share, what)).map(drop),
            _ => Ok(()),
        };
        if let Err(error) = outcome.and_then(|()| py.check_signals()) {
            is_given_up.store(true, Ordering::Relaxed);
            return Err(error);
        }
    }
    match py.detach(move || worker.join()) {
        Ok(done) => Ok(done),
        Err(fault) => resume_unwind(fault),
    }
}

/// Returns an exception of a class of `dynocar/_errors.py`.
fn raised<'py>(py: Python<'py>, class: &str, arguments: impl PyCallArgs<'py>) -> PyErr {
    let class = py.import("dynocar._errors").and_then(|module| module.getattr(class));
    match class.and_then(|class| class.call1(arguments)) {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

/// Returns a code of the interface, in its own words.
pub(crate) fn of_code(py: Python<'_>, code: Code) -> PyErr {
    raised(py, "ChannelError", (code.text().to_string_lossy(), code as i32))
}

/// Returns a channel that cannot be opened or used.
pub(crate) fn of_channel(py: Python<'_>, error: &ChannelError) -> PyErr {
    raised(py, "ChannelError", (error.to_string(), Code::from(error) as i32))
}

/// Returns a command that ended without its result.
pub(crate) fn of_failure(py: Python<'_>, failure: &Failure) -> PyErr {
    match failure.answer() {
        Some(it) if it.exit_status == 2 => raised(py, "InputError", (it.message, it.file, it.line)),
        Some(it) => raised(py, "WorkError", (it.message,)),
        None => raised(py, "WorkError", ("the result is bad news, reported already",)),
    }
}
