//! Ctrl-C: a command finishes its present work, gives its results so far, and ends with [`STATUS`]; a second Ctrl-C
//! ends it at once.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use dynocar::ending;
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::output::BenchError;

/// Exit status of a command that a signal ended, with or without results: the status of a program that SIGINT ends.
pub const STATUS: u8 = 130;

static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Begins to listen for signals.
///
/// # Errors
///
/// When the system takes no handler.
pub fn begin() -> Result<(), BenchError> {
    let is_second = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // Handlers run in the order of their registration.
        signal_hook::flag::register_conditional_default(signal, is_second.clone())?;
        signal_hook::flag::register(signal, is_second.clone())?;
    }
    let flag = ending::flag()?;
    FLAG.get_or_init(|| flag);
    Ok(())
}

/// Returns the flag that is set once the command is to end.
pub fn flag() -> &'static AtomicBool {
    FLAG.get_or_init(Arc::default)
}

/// Returns whether the command is to end.
pub fn is_due() -> bool {
    flag().load(Ordering::Relaxed)
}

/// Yields the items until the command is to end.
pub fn until_due<I: IntoIterator>(items: I) -> impl Iterator<Item = I::Item> {
    items.into_iter().take_while(|_| !is_due())
}
