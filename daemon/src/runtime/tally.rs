//! What a pipeline thread tells the main thread, without either waiting.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crossbeam::utils::CachePadded;
use dynocar_core::plausibility::{Finding, Slip};
use dynocar_shared::ParameterSnapshot;

/// Counters of one pipeline for one train, written by its thread, read by the main thread.
#[derive(Debug, Default)]
pub struct Tally {
    counters: CachePadded<Counters>,
}

#[derive(Debug, Default)]
struct Counters {
    used: AtomicU64,
    rejected: AtomicU64,
    lost: AtomicU64,
    unsent: AtomicU64,
    status: AtomicU64,
    implausible: AtomicU64,
    beats: AtomicU64,
}

/// A tally at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TallyReading {
    /// Samples that entered the estimate.
    pub used: u64,
    /// Samples refused.
    pub rejected: u64,
    /// Samples that never arrived.
    pub lost: u64,
    /// Snapshots that the transport did not take.
    pub unsent: u64,
    /// Changes with every sign of life of the pipeline's thread.
    pub beats: u64,
    /// Status and reason of the newest snapshot, by number.
    pub status: (u32, u32),
    /// What cannot be true of the samples lately.
    pub implausible: Option<Finding>,
}

impl Tally {
    /// Takes over the counters of a snapshot.
    ///
    /// # Real-time
    ///
    /// Plain stores into one cache line of the thread's own.
    pub fn note(&self, snapshot: &ParameterSnapshot, implausible: Option<Finding>) {
        self.counters.used.store(snapshot.samples_used, Relaxed);
        self.counters.rejected.store(snapshot.samples_rejected, Relaxed);
        self.counters.lost.store(snapshot.samples_lost, Relaxed);
        let status = u64::from(snapshot.status) << 32 | u64::from(snapshot.reason);
        self.counters.status.store(status, Relaxed);
        self.counters.implausible.store(packed(implausible), Relaxed);
        let beats = self.counters.beats.load(Relaxed).wrapping_add(1);
        self.counters.beats.store(beats, Relaxed);
    }

    /// Counts a snapshot that the transport did not take.
    pub fn note_unsent(&self) {
        self.counters.unsent.fetch_add(1, Relaxed);
    }

    /// The counters now.
    pub fn read(&self) -> TallyReading {
        let status = self.counters.status.load(Relaxed);
        TallyReading {
            used: self.counters.used.load(Relaxed),
            rejected: self.counters.rejected.load(Relaxed),
            lost: self.counters.lost.load(Relaxed),
            unsent: self.counters.unsent.load(Relaxed),
            beats: self.counters.beats.load(Relaxed),
            status: ((status >> 32) as u32, status as u32),
            implausible: unpacked(self.counters.implausible.load(Relaxed)),
        }
    }
}

/// A finding in one word: the slip's number, and its factor in single precision.
fn packed(finding: Option<Finding>) -> u64 {
    finding.map_or(0, |it| u64::from(it.slip as u8) << 32 | u64::from((it.factor as f32).to_bits()))
}

fn unpacked(word: u64) -> Option<Finding> {
    let slip = Slip::from_number((word >> 32) as u8)?;
    Some(Finding { slip, factor: f64::from(f32::from_bits(word as u32)) })
}
