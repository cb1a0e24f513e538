//! The same work over many cases, on some threads.

use std::sync::atomic::{AtomicUsize, Ordering};

/// Does `work` on every case on `threads` threads, which leave those of rayon to the work; gives the results
/// in the order of the cases.
///
/// # Panics
///
/// When the work does.
pub fn over<C: Sync, R: Send>(
    cases: &[C],
    threads: usize,
    work: impl Fn(&C) -> R + Sync,
) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let take = || {
        let at = next.fetch_add(1, Ordering::Relaxed);
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
    use super::over;

    #[test]
    fn every_case_is_worked_on_once_and_in_order() {
        for (count, threads) in [(0, 3), (1, 4), (7, 2), (50, 1)] {
            let cases: Vec<usize> = (0..count).collect();
            assert_eq!(over(&cases, threads, |case| *case), cases);
        }
    }
}
