//! Long work: the lock of Python's interpreter is free meanwhile, progress is reported in the caller's
//! thread, and a signal (Ctrl-C) ends it.

use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// How often signals are looked for.
pub(crate) const SIGNALS_EVERY: Duration = Duration::from_millis(50);

/// Given the share done, 0 to 1, and what is being done.
pub(crate) type Progress<'p> = &'p (dyn Fn(f64, &str) + Sync);

/// Does the work in a thread of its own and calls `progress` with its steps. When a signal or
/// `progress` raises, that is what the caller gets at once, and the work ends at its next step.
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
