//! Cores and priorities of a measurement.

use dynocar::output::report_line;
use dynocar::runtime::affinity::pin_to_core;
use dynocar::runtime::scheduling::set_fifo_priority;

use super::RigError;

/// The two cores of a measurement, and the priority of what runs there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cores {
    /// Where the controller publishes and polls.
    pub controller: usize,
    /// Where the answering thread runs.
    pub server: usize,
    /// Real-time priority on both; ordinary when absent.
    pub priority: Option<u8>,
}

impl Cores {
    /// The cores asked for, else the first two; on a machine with one core both are the same.
    pub fn choose(controller: Option<usize>, server: Option<usize>, priority: Option<u8>) -> Self {
        let count = std::thread::available_parallelism().map_or(1, usize::from);
        let controller = controller.unwrap_or(0);
        let other = (controller + 1) % count.max(1);
        Cores { controller, server: server.unwrap_or(other), priority }
    }
}

/// Runs something in a thread of its own, which it may bind to a core: threads and processes
/// that are started before are not bound with it.
///
/// # Errors
///
/// The work's own.
pub fn in_thread<T: Send>(
    work: impl FnOnce() -> Result<T, RigError> + Send,
) -> Result<T, RigError> {
    std::thread::scope(|scope| match scope.spawn(work).join() {
        Ok(result) => result,
        Err(panic) => std::panic::resume_unwind(panic),
    })
}

/// Binds the calling thread to a core; without that the figures vary more, which is said.
pub fn bind(core: usize) {
    if let Err(error) = pin_to_core(core) {
        report_line(&format!(
            "dynocar-bench: not bound to core {core}, figures will vary more: {error}"
        ));
    }
}

/// Gives the calling thread, and every thread it starts from then on, a real-time priority; without
/// it the figures vary more, which is said.
pub fn prioritise(priority: Option<u8>) {
    if let Some(priority) = priority
        && let Err(error) = set_fifo_priority(priority)
    {
        report_line(&format!(
            "dynocar-bench: no priority {priority}, figures will vary more: {error}"
        ));
    }
}
