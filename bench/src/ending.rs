//! Ctrl-C: a command finishes its present work, gives its results so far, and ends with [`STATUS`]; a second Ctrl-C
//! ends it at once. And the same work over many cases, on some threads, until then.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
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

/// Does `work` on every case, but begins no further case once the command is to end. It runs on `threads` new threads,
/// not on rayon's, so that `work` itself may use rayon. Returns the results of the cases that were begun, the first
/// ones, in their order.
///
/// # Panics
///
/// When the work does.
pub fn over_until_due<C: Sync, R: Send>(
    cases: &[C],
    threads: usize,
    work: impl Fn(&C) -> R + Sync,
) -> Vec<R> {
    over_while(cases, threads, work, || !is_due())
}

/// Cases are taken in order and finished: those that are done are the first.
fn over_while<C: Sync, R: Send>(
    cases: &[C],
    threads: usize,
    work: impl Fn(&C) -> R + Sync,
    goes_on: impl Fn() -> bool + Sync,
) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let take = || {
        let at = goes_on().then(|| next.fetch_add(1, Ordering::Relaxed))?;
        cases.get(at).map(|case| (at, work(case)))
    };
    let mut results: Vec<(usize, R)> = std::thread::scope(|scope| {
        let worker = || std::iter::from_fn(take).collect::<Vec<_>>();
        let workers: Vec<_> = (0..threads.max(1)).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().flat_map(|it| it.join().expect("work without panic")).collect()
    });
    results.sort_by_key(|(at, _)| *at);
    results.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_is_worked_on_once_and_in_order() {
        for (count, threads) in [(0, 3), (1, 4), (7, 2), (50, 1)] {
            let cases: Vec<usize> = (0..count).collect();
            assert_eq!(over_while(&cases, threads, |case| *case, || true), cases);
        }
    }

    #[test]
    fn what_was_taken_before_the_end_is_finished_and_comes_first() {
        let cases: Vec<usize> = (0..50).collect();
        let is_over = std::sync::atomic::AtomicBool::new(false);
        let work = |case: &usize| {
            is_over.fetch_or(*case == 20, std::sync::atomic::Ordering::Relaxed);
            *case
        };
        let done =
            over_while(&cases, 3, work, || !is_over.load(std::sync::atomic::Ordering::Relaxed));
        assert!((21..=23).contains(&done.len()) && cases.starts_with(&done), "{done:?}");
    }
}
