//! The host's monotonic clock, common to all its processes.

use rustix::time::{ClockId, clock_gettime};

/// Nanoseconds since boot, never set back; read through the vDSO, without a system call.
pub fn monotonic_now_ns() -> i64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}
