//! Signs of life and counts, and details for the log, that no snapshot carries: a pipeline thread notes them, and the
//! main thread reads them, without waiting on either side.

use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

use crossbeam_utils::CachePadded;
use dynocar_core::plausibility::{DetectedFault, InputFault};

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

/// Details of one pipeline for one train, written by its thread, read by the log.
#[derive(Debug, Default)]
pub struct LogDetails {
    words: CachePadded<Words>,
}

#[derive(Debug, Default)]
struct Words {
    /// See [`packed`].
    implausible: AtomicU64,
    /// Bits of the position in m.
    position_m: AtomicU64,
}

impl LogDetails {
    /// Notes the recent input fault of the samples, with its factor; a snapshot carries only the reason.
    ///
    /// # Real-time
    ///
    /// A plain store into memory that only this thread writes.
    pub fn note_implausible(&self, implausible: Option<DetectedFault>) {
        self.words.implausible.store(packed(implausible), Relaxed);
    }

    /// Notes where the train is, in m; NaN where it does not know.
    ///
    /// # Real-time
    ///
    /// A plain store into memory that only this thread writes.
    pub fn note_position(&self, position_m: f64) {
        self.words.position_m.store(position_m.to_bits(), Relaxed);
    }

    /// Returns the recent input fault of the samples.
    pub fn implausible(&self) -> Option<DetectedFault> {
        unpacked(self.words.implausible.load(Relaxed))
    }

    /// Returns where the train is, in m; NaN where it does not know.
    pub fn position_m(&self) -> f64 {
        f64::from_bits(self.words.position_m.load(Relaxed))
    }
}

/// Returns a detected fault in one word: the input fault's number, and its factor in single precision.
fn packed(detected: Option<DetectedFault>) -> u64 {
    let word = |it: DetectedFault| {
        u64::from(it.fault as u8) << 32 | u64::from((it.factor as f32).to_bits())
    };
    detected.map_or(0, word)
}

fn unpacked(word: u64) -> Option<DetectedFault> {
    let fault = InputFault::from_number((word >> 32) as u8)?;
    Some(DetectedFault { fault, factor: f64::from(f32::from_bits(word as u32)) })
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

#[cfg(test)]
mod log_details_tests {
    use super::*;

    #[test]
    fn what_a_thread_notes_is_read_again() {
        let details = LogDetails::default();
        assert_eq!((details.implausible(), details.position_m()), (None, 0.0));
        let implausible = Some(DetectedFault { fault: InputFault::BrakeScale, factor: -0.5 });
        details.note_implausible(implausible);
        details.note_position(3_214.0);
        assert_eq!((details.implausible(), details.position_m()), (implausible, 3_214.0));
    }
}
