//! Each cycle of a controller and of a pipeline's thread allocates nothing, makes no system call, and neither
//! faults nor waits. The allocator is of this program alone, and counts by thread.

use std::sync::{Mutex, MutexGuard, PoisonError};

mod no_allocation;
mod no_system_call;
mod real_time;

/// Held while a daemon may keep a core for itself by priority, on which a controller beside it would stand still.
fn hold_the_cores() -> MutexGuard<'static, ()> {
    static CORES: Mutex<()> = Mutex::new(());
    CORES.lock().unwrap_or_else(PoisonError::into_inner)
}
