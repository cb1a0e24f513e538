//! The same work over many cases, on some threads.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::ending;

/// Does `work` on every case. It runs on `threads` new threads, not on rayon's, so that `work` itself may use rayon.
/// Returns the results in the order of the cases.
///
/// # Panics
///
/// When the work does.
pub fn over<C: Sync, R: Send>(
    cases: &[C],
    threads: usize,
    work: impl Fn(&C) -> R + Sync,
) -> Vec<R> {
    over_while(cases, threads, work, || true)
}

/// Does the same, but begins no further case once the command is to end. Returns the results of the cases that were
/// begun, the first ones.
///
/// # Panics
///
/// When the work does.
pub fn until_due<C: Sync, R: Send>(
    cases: &[C],
    threads: usize,
    work: impl Fn(&C) -> R + Sync,
) -> Vec<R> {
    over_while(cases, threads, work, || !ending::is_due())
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
    use super::{over, over_while};

    #[test]
    fn every_case_is_worked_on_once_and_in_order() {
        for (count, threads) in [(0, 3), (1, 4), (7, 2), (50, 1)] {
            let cases: Vec<usize> = (0..count).collect();
            assert_eq!(over(&cases, threads, |case| *case), cases);
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
