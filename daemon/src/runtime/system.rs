//! Requests of a thread to the system: resident memory, a core of its own, a real-time priority, files, and programs
//! that end with it.

use std::io::ErrorKind;
use std::os::unix::process::CommandExt;
use std::process::Command;

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{
    Resource, Rlimit, Signal, getpid, getppid, getrlimit, set_parent_process_death_signal,
    setrlimit,
};
use rustix::thread::{CapabilitySet, CpuSet, capabilities, sched_setaffinity};

/// Stack of a pipeline thread in bytes: opening the transport's ports takes more than half a MiB
/// of it. Locked memory holds all of it.
pub const STACK_BYTES: usize = 2 * 1024 * 1024;
/// Stack that is touched before a thread works, in bytes.
const PREFAULT_BYTES: usize = 256 * 1024;
const PAGE_BYTES: usize = 4096;

/// Why memory is not locked.
#[derive(Debug, thiserror::Error)]
pub enum LockError {
    /// The limit is finite: later mappings would fail at it.
    #[error(
        "this process may lock {limit_bytes} bytes; it needs CAP_IPC_LOCK or no such limit \
         (systemd: LimitMEMLOCK=infinity)"
    )]
    Limit {
        /// The limit of this process.
        limit_bytes: u64,
    },
    /// The system refused.
    #[error("{0}")]
    Refused(#[from] std::io::Error),
}

/// Locks all present and future memory of the process, and keeps freed memory on the heap.
///
/// # Errors
///
/// When the process may not lock without limit: with a limit, a mapping that comes later would
/// fail once it is reached, and no lock at all is the lesser evil.
pub fn lock_all_memory() -> Result<(), LockError> {
    let is_capable =
        capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK));
    if let Some(limit_bytes) = getrlimit(Resource::Memlock).current.filter(|_| !is_capable) {
        return Err(LockError::Limit { limit_bytes });
    }
    keep_freed_memory();
    mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map_err(std::io::Error::from)?;
    Ok(())
}

/// The allocator gives nothing back to the system and maps nothing apart: memory that was once
/// used stays mapped.
#[cfg(target_env = "gnu")]
fn keep_freed_memory() {
    // SAFETY: both parameters may be set at any time; a refusal leaves the default.
    unsafe {
        libc::mallopt(libc::M_TRIM_THRESHOLD, -1);
        libc::mallopt(libc::M_MMAP_MAX, 0);
    }
}

#[cfg(not(target_env = "gnu"))]
fn keep_freed_memory() {}

/// Touches the part of the calling thread's stack that its work may need, locked or not.
pub fn prefault_stack() {
    let mut pages = [0_u8; PREFAULT_BYTES];
    for page in pages.chunks_mut(PAGE_BYTES) {
        page[0] = 1;
        std::hint::black_box(&mut *page);
    }
}

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

/// Gives the calling thread a real-time priority, 1 to 99 (`SCHED_FIFO`): it runs before every
/// thread of ordinary priority, until it waits of its own accord.
///
/// # Errors
///
/// The system's answer: without the privilege, `EPERM`.
pub fn set_fifo_priority(priority: u8) -> std::io::Result<()> {
    let parameters = libc::sched_param { sched_priority: libc::c_int::from(priority) };
    // SAFETY: `parameters` outlives the call, and 0 names the calling thread.
    let answer = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameters) };
    if answer == 0 { Ok(()) } else { Err(std::io::Error::last_os_error()) }
}

/// Lets the calling thread run only where no thread of ordinary niceness wants to, or nearly so.
pub fn stand_back() {
    const NICENESS: libc::c_int = 10;
    // SAFETY: no memory is involved; 0 names the calling thread. Who is nice needs no privilege.
    unsafe { libc::setpriority(libc::PRIO_PROCESS, 0, NICENESS) };
}

/// Lets a program end when the thread that starts it ends for any reason, so that no program goes on without somebody
/// who waits for it.
pub fn ends_with_this(command: &mut Command) -> &mut Command {
    let parent = getpid();
    // SAFETY: between fork and exec only system calls are made.
    unsafe {
        command.pre_exec(move || {
            set_parent_process_death_signal(Some(Signal::TERM))?;
            // It may have ended before.
            if getppid() == Some(parent) { Ok(()) } else { Err(ErrorKind::BrokenPipe.into()) }
        })
    }
}

/// Lets this process open as many files as its hard limit allows; each connection of a reader takes some.
pub fn raise_open_files() {
    let limit = getrlimit(Resource::Nofile);
    // A refusal is named once the limit is reached.
    let _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_named_in_words_with_the_remedy() {
        let message = LockError::Limit { limit_bytes: 8192 }.to_string();
        assert!(message.contains("8192 bytes") && message.contains("CAP_IPC_LOCK"), "{message}");
    }

    #[test]
    fn the_touched_stack_fits_into_a_threads_stack() {
        const { assert!(PREFAULT_BYTES <= STACK_BYTES / 2) };
        std::thread::Builder::new()
            .stack_size(STACK_BYTES)
            .spawn(prefault_stack)
            .unwrap()
            .join()
            .unwrap();
    }
}

#[cfg(test)]
mod scheduling_tests {
    use super::*;

    #[test]
    fn a_priority_beyond_the_system_is_refused() {
        assert!(set_fifo_priority(200).is_err());
    }

    #[test]
    fn a_thread_has_the_priority_or_the_reason_is_the_privilege() {
        std::thread::spawn(|| match set_fifo_priority(1) {
            // SAFETY: 0 names the calling thread.
            Ok(()) => assert_eq!(unsafe { libc::sched_getscheduler(0) }, libc::SCHED_FIFO),
            Err(error) => assert_eq!(error.kind(), std::io::ErrorKind::PermissionDenied),
        })
        .join()
        .unwrap();
    }
}
