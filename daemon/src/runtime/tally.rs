//! Signs of life and counts that a pipeline thread reports to the main thread in addition to its snapshots, without
//! waiting on either side.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crossbeam_utils::CachePadded;

/// Counters of one pipeline for one train, written by its thread, read by the main thread.
#[derive(Debug, Default)]
pub struct Tally {
    counters: CachePadded<Counters>,
}

#[derive(Debug, Default)]
struct Counters {
    beats: AtomicU64,
    unsent: AtomicU64,
}

impl Tally {
    /// Notes a sign of life.
    ///
    /// # Real-time
    ///
    /// Plain loads and stores of memory that only this thread writes.
    pub fn note_beat(&self) {
        let beats = self.beats().wrapping_add(1);
        self.counters.beats.store(beats, Relaxed);
    }

    /// Counts a snapshot that the transport did not take.
    pub fn note_unsent(&self) {
        self.counters.unsent.fetch_add(1, Relaxed);
    }

    /// Returns a number that changes with every sign of life of the pipeline's thread.
    pub fn beats(&self) -> u64 {
        self.counters.beats.load(Relaxed)
    }

    /// Returns the number of snapshots that the transport did not take.
    pub fn unsent(&self) -> u64 {
        self.counters.unsent.load(Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_thread_counts_is_read_by_another() {
        let tally = Tally::default();
        assert_eq!((tally.beats(), tally.unsent()), (0, 0));
        tally.note_beat();
        tally.note_beat();
        tally.note_unsent();
        assert_eq!((tally.beats(), tally.unsent()), (2, 1));
    }
}
