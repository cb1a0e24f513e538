//! Each cycle of a controller and of a pipeline's thread allocates nothing, makes no system call, and neither faults
//! nor waits. The allocator belongs to this program alone, and counts by thread.

use std::sync::{Mutex, MutexGuard, PoisonError};

mod no_allocation;
mod no_system_call;
mod real_time;

/// Returns a lock for the time in which a daemon may keep a core for itself by its priority: other controllers on that
/// core would stand still.
fn hold_the_cores() -> MutexGuard<'static, ()> {
    static CORES: Mutex<()> = Mutex::new(());
    CORES.lock().unwrap_or_else(PoisonError::into_inner)
}
