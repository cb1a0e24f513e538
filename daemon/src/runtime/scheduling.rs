//! Real-time priority of a thread.

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

#[cfg(test)]
mod tests {
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
