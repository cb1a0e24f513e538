//! Counts that a pipeline thread reports to the main thread in addition to its snapshots, without waiting on either
//! side.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

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
    implausible: AtomicU64,
    /// Position of the train in m.
    position_m: AtomicU64,
}

/// A tally at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TallyReading {
    /// Changes with every sign of life of the pipeline's thread.
    pub beats: u64,
    /// Snapshots that the transport did not take.
    pub unsent: u64,
    /// Recent input fault of the samples, with its factor; a snapshot carries only the reason.
    pub implausible: Option<DetectedFault>,
    /// Where the train is, in m; no number where it does not know.
    pub position_m: f64,
}

impl Tally {
    /// Notes a sign of life.
    ///
    /// # Real-time
    ///
    /// Plain stores into memory that only this thread writes.
    pub fn note(&self, implausible: Option<DetectedFault>) {
        self.counters.implausible.store(packed(implausible), Relaxed);
        let beats = self.counters.beats.load(Relaxed).wrapping_add(1);
        self.counters.beats.store(beats, Relaxed);
    }

    /// Notes where the train is, in m; no number where it does not know.
    pub fn note_position(&self, position_m: f64) {
        self.counters.position_m.store(position_m.to_bits(), Relaxed);
    }

    /// Counts a snapshot that the transport did not take.
    pub fn note_unsent(&self) {
        self.counters.unsent.fetch_add(1, Relaxed);
    }

    /// Returns the counters now.
    pub fn read(&self) -> TallyReading {
        TallyReading {
            beats: self.counters.beats.load(Relaxed),
            unsent: self.counters.unsent.load(Relaxed),
            implausible: unpacked(self.counters.implausible.load(Relaxed)),
            position_m: f64::from_bits(self.counters.position_m.load(Relaxed)),
        }
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
    fn what_a_thread_notes_is_read_again() {
        let tally = Tally::default();
        assert_eq!(tally.read(), TallyReading::default());
        let implausible = Some(DetectedFault { fault: InputFault::BrakeScale, factor: -0.5 });
        tally.note(implausible);
        tally.note_position(3_214.0);
        tally.note_unsent();
        let expected = TallyReading { beats: 1, unsent: 1, implausible, position_m: 3_214.0 };
        assert_eq!(tally.read(), expected);
    }
}
