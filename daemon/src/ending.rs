//! The end of a long-running program: by request, or because its terminal is gone.
//!
//! A closed terminal sends SIGHUP to the programs in its foreground and nothing to others that write to it; for those
//! the terminal itself is watched. A program that is started with SIGHUP ignored, as by `nohup`, is meant to outlive
//! its terminal, and it does.

use std::io::{self, IsTerminal, stderr, stdin, stdout};
use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

/// Why a program cannot be notified of its end.
#[derive(Debug, thiserror::Error)]
pub enum EndingError {
    /// The system takes no handler.
    #[error("signal handler: {0}")]
    Signal(io::Error),
    /// The system gives no second handle or no thread.
    #[error("watching the terminal: {0}")]
    Terminal(io::Error),
}

/// Stack of the thread that waits for the terminal's end: it may be locked into memory.
const STACK_BYTES: usize = 64 * 1024;

/// When the program ends.
pub struct ProgramEnding {
    /// Set when it is to end: by SIGTERM, SIGINT or SIGHUP, or when its terminal is gone.
    pub flag: Arc<AtomicBool>,
    /// The terminals that it was started on.
    terminals: Arc<Vec<OwnedFd>>,
}

/// Returns the flag alone, for a program that shows nothing on its terminal.
///
/// # Errors
///
/// When the system takes no handler, or gives no thread.
pub fn flag() -> Result<Arc<AtomicBool>, EndingError> {
    Ok(ProgramEnding::begin()?.flag)
}

impl ProgramEnding {
    /// Begins to listen for signals, and to watch the terminal.
    ///
    /// # Errors
    ///
    /// When the system takes no handler, or gives no thread.
    pub fn begin() -> Result<Self, EndingError> {
        let flag = Arc::new(AtomicBool::new(false));
        let terminals = Arc::new(terminals().map_err(EndingError::Terminal)?);
        let mut signals = vec![SIGTERM, SIGINT];
        if !outlives_its_terminal() {
            signals.push(SIGHUP);
            if !terminals.is_empty() {
                watch(Arc::clone(&terminals), Arc::clone(&flag)).map_err(EndingError::Terminal)?;
            }
        }
        for signal in signals {
            signal_hook::flag::register(signal, Arc::clone(&flag)).map_err(EndingError::Signal)?;
        }
        Ok(ProgramEnding { flag, terminals })
    }

    /// Returns whether the program is to end.
    pub fn is_due(&self) -> bool {
        self.flag.load(Ordering::Relaxed)
    }

    /// Returns whether the terminal is gone; a program that outlives it sees that here alone.
    pub fn is_terminal_gone(&self) -> bool {
        is_one_gone(&self.terminals, Some(&Timespec::default()))
    }
}

/// Handles of the terminals among the standard streams, which nobody else closes.
fn terminals() -> io::Result<Vec<OwnedFd>> {
    let (input, output, errors) = (stdin(), stdout(), stderr());
    [
        (input.is_terminal(), input.as_fd()),
        (output.is_terminal(), output.as_fd()),
        (errors.is_terminal(), errors.as_fd()),
    ]
    .into_iter()
    .filter_map(|(is_terminal, stream)| is_terminal.then_some(stream))
    .map(|stream| stream.try_clone_to_owned())
    .collect()
}

/// Sets the flag once one of the terminals is gone, on a thread that sleeps until then.
fn watch(terminals: Arc<Vec<OwnedFd>>, flag: Arc<AtomicBool>) -> io::Result<()> {
    let wait = move || {
        if is_one_gone(&terminals, None) {
            flag.store(true, Ordering::Relaxed);
        }
    };
    let builder = std::thread::Builder::new().name("terminal".into()).stack_size(STACK_BYTES);
    builder.spawn(wait).map(drop)
}

/// Waits, at most so long, for one of the terminals to go.
fn is_one_gone(terminals: &[OwnedFd], at_most: Option<&Timespec>) -> bool {
    // The data to read or write do not matter here: the end is always reported.
    let mut polled: Vec<PollFd<'_>> =
        terminals.iter().map(|it| PollFd::new(it, PollFlags::empty())).collect();
    loop {
        match poll(&mut polled, at_most) {
            Err(rustix::io::Errno::INTR) => {}
            Err(_) => return false,
            Ok(count) => return count > 0,
        }
    }
}

/// Returns whether SIGHUP was ignored from the start.
fn outlives_its_terminal() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    is_ignored(&status, SIGHUP)
}

/// Returns whether the kernel's page on a process says that it ignores a signal.
fn is_ignored(status: &str, signal: i32) -> bool {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ignored_signals_are_read_off_the_kernels_page() {
        let page = "Name:\tdynocar\nSigBlk:\t0000000000000001\nSigIgn:\t0000000000001001\n";
        assert!(is_ignored(page, SIGHUP) && !is_ignored(page, SIGTERM));
        assert!(!is_ignored("SigIgn:\t0000000000001000\n", SIGHUP));
        assert!(!is_ignored("", SIGHUP));
    }
}
