//! Exchange of pipelines: those of another model go to work, and those at work come back.
//!
//! One thread, the shadow's, hands over the pipelines of a train for all threads that serve it. Each of these takes its
//! own when the train stands, between two samples, and gives its old ones back. The first thread that sees the train
//! stand settles the number of the sample after which all of them change, so that they agree and no thread waits for
//! another. No thread locks or allocates.

use std::sync::atomic::{AtomicU64, Ordering};

use crossbeam_queue::ArrayQueue;
use dynocar_core::pipeline::Pipeline;

/// The pipelines of one train on one thread, in the order of its slots.
pub type Set = Vec<Pipeline>;

/// No thread has settled the sample yet.
const OPEN: u64 = u64::MAX;
/// Mark of a value that is being withdrawn.
const WITHDRAWN: u64 = u64::MAX - 1;

/// The way to the threads and back for the pipelines of one train.
#[derive(Debug)]
pub struct Exchange {
    /// Number of the sample after which to change, [`OPEN`] or [`WITHDRAWN`].
    settled: AtomicU64,
    seats: Vec<Seat>,
}

/// One thread's part of the exchange.
struct Seat {
    inbox: ArrayQueue<Set>,
    outbox: ArrayQueue<Set>,
}

impl std::fmt::Debug for Seat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} there, {} back", self.inbox.len(), self.outbox.len())
    }
}

impl Exchange {
    /// For as many threads as serve the train.
    pub fn new(seats: usize) -> Self {
        let seat = |_| Seat { inbox: ArrayQueue::new(1), outbox: ArrayQueue::new(1) };
        Exchange { settled: AtomicU64::new(WITHDRAWN), seats: (0..seats).map(seat).collect() }
    }

    /// Hands over one set for each thread. All sets handed over before must be back.
    ///
    /// # Panics
    ///
    /// When there are not as many sets as threads.
    pub fn hand_over(&self, sets: Vec<Set>) {
        assert_eq!(sets.len(), self.seats.len());
        for (seat, set) in self.seats.iter().zip(sets) {
            let is_taken = seat.inbox.push(set).is_ok();
            debug_assert!(is_taken, "what was handed over before is back");
        }
        self.settled.store(OPEN, Ordering::Release);
    }

    /// Takes back the sets handed over; `None` when a thread has begun to change.
    pub fn withdraw(&self) -> Option<Vec<Set>> {
        let (now, then) = (OPEN, WITHDRAWN);
        self.settled.compare_exchange(now, then, Ordering::AcqRel, Ordering::Acquire).ok()?;
        Some(self.seats.iter().filter_map(|seat| seat.inbox.pop()).collect())
    }

    /// Returns the old pipelines, by thread, once all threads have changed.
    pub fn come_back(&self) -> Option<Vec<Set>> {
        let are_all = self.seats.iter().all(|seat| !seat.outbox.is_empty());
        are_all.then(|| self.seats.iter().filter_map(|seat| seat.outbox.pop()).collect())
    }

    /// For a thread between two samples: its new pipelines, when it is time to change. `newest` is
    /// the number of the newest sample that it took, and `stands` whether the train stands in it.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing.
    pub fn take(&self, seat: usize, newest: u64, stands: bool) -> Option<Set> {
        let mut settled = self.settled.load(Ordering::Acquire);
        if settled == OPEN && stands {
            let ordering = (Ordering::AcqRel, Ordering::Acquire);
            settled = match self.settled.compare_exchange(OPEN, newest, ordering.0, ordering.1) {
                Ok(_) => newest,
                Err(other) => other,
            };
        }
        let is_time = settled < WITHDRAWN && newest >= settled;
        if is_time { self.seats[seat].inbox.pop() } else { None }
    }

    /// Gives the old pipelines back.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing.
    pub fn give_back(&self, seat: usize, old: Set) {
        // The place is free: the thread that hands over waits for the return of the set before.
        let _ = self.seats[seat].outbox.push(old);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_change_after_the_sample_at_which_the_first_saw_the_train_stand() {
        let exchange = Exchange::new(2);
        exchange.hand_over(vec![Vec::new(), Vec::new()]);
        assert!(exchange.take(0, 41, false).is_none(), "it moves");
        assert!(exchange.take(0, 42, true).is_some());
        assert!(exchange.take(1, 41, true).is_none(), "not yet at the sample");
        assert!(exchange.withdraw().is_none(), "one has changed");
        assert!(exchange.come_back().is_none());
        assert!(exchange.take(1, 43, false).is_some(), "it moves again, but all agreed");
        exchange.give_back(0, Vec::new());
        exchange.give_back(1, Vec::new());
        assert_eq!(exchange.come_back().map(|sets| sets.len()), Some(2));
        assert!(exchange.take(0, 44, true).is_none(), "nothing is handed over twice");
    }

    #[test]
    fn what_no_thread_took_can_be_taken_back() {
        let exchange = Exchange::new(2);
        exchange.hand_over(vec![Vec::new(), Vec::new()]);
        assert_eq!(exchange.withdraw().map(|sets| sets.len()), Some(2));
        assert!(exchange.take(0, 42, true).is_none());
    }
}
