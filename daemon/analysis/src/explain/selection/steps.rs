//! How far a search is.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::explain::effects::Effect;

/// Told how far the work is, by any thread: share done, and what is being done. It may unwind to end the
/// work, which holds nothing that would have to be put right.
pub type Progress<'p> = &'p (dyn Fn(f64, &str) + Sync);

/// How many steps of a round are done, by all threads together.
pub struct Steps<'s> {
    progress: Progress<'s>,
    round: usize,
    count: usize,
    done: AtomicUsize,
}

/// Share done before a round ends: nobody knows how many there will be, and most have few.
pub fn round_share(round: usize, done: f64) -> f64 {
    let left = 0.5f64.powi(round as i32) * (1.0 - 0.5 * done);
    0.05 + 0.9 * (1.0 - left)
}

impl<'s> Steps<'s> {
    /// Of a round after so many effects, which takes this number of steps at most.
    pub fn of(progress: Progress<'s>, round: usize, count: usize) -> Self {
        Steps { progress, round, count, done: AtomicUsize::new(0) }
    }

    /// Does one step for a kind.
    pub fn done_with<T>(&self, effect: &Effect, step: impl FnOnce() -> T) -> T {
        let share = || self.done.load(Ordering::Relaxed) as f64 / self.count as f64;
        (self.progress)(round_share(self.round, share()), effect.kind.name());
        let result = step();
        self.done.fetch_add(1, Ordering::Relaxed);
        (self.progress)(round_share(self.round, share()), effect.kind.name());
        result
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::explain::effects::LIBRARY;

    #[test]
    fn shares_grow_from_step_to_step_and_from_round_to_round() {
        let shares = Mutex::new(Vec::new());
        let progress = |share: f64, _: &str| shares.lock().unwrap().push(share);
        for round in 0..5 {
            let steps = Steps::of(&progress, round, 3);
            (0..3).for_each(|_| steps.done_with(&LIBRARY[0], || ()));
        }
        let shares = shares.into_inner().unwrap();
        assert_eq!(shares.len(), 30);
        assert!(shares.windows(2).all(|pair| pair[0] <= pair[1]), "{shares:?}");
        assert!(shares[0] > 0.0 && shares[29] < 1.0);
    }
}
