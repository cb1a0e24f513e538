//! Binding a thread to a core.

use rustix::thread::{CpuSet, sched_setaffinity};

/// Binds the calling thread to one core.
///
/// # Errors
///
/// The system's answer, for instance when the core is not among those this process may use.
pub fn pin_to_core(core: usize) -> std::io::Result<()> {
    if core >= CpuSet::MAX_CPU {
        return Err(std::io::Error::from(std::io::ErrorKind::InvalidInput));
    }
    let mut cores = CpuSet::new();
    cores.set(core);
    sched_setaffinity(None, &cores).map_err(std::io::Error::from)
}
