//! Reports of a pipeline thread to the main thread, without either waiting.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

use crossbeam_utils::CachePadded;
use dynocar_core::plausibility::{DetectedFault, InputFault};
use dynocar_shared::ParameterSnapshot;
use dynocar_shared::snapshot::REJECTION_REASONS;

use crate::operator::suspicion::Suspicion;

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
    refused: [AtomicU32; REJECTION_REASONS],
    suspect: Suspect,
}

/// Latest suspicion, the newest of each word.
#[derive(Debug, Default)]
struct Suspect {
    /// The effect's number, and its rivals' bits.
    effect: AtomicU64,
    /// Evidence in single precision, and age in s.
    evidence: AtomicU64,
    /// Force and standard deviation in single precision.
    force: AtomicU64,
    /// Where the train is, in m.
    position_m: AtomicU64,
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
    /// Recent impossibilities of the samples.
    pub implausible: Option<DetectedFault>,
    /// Samples refused, by number of the reason.
    pub refused: [u32; REJECTION_REASONS],
    /// Suspicion of the pipeline.
    pub suspicion: Option<Suspicion>,
    /// Where the train is, in m; no number where it does not know.
    pub position_m: f64,
}

impl Tally {
    /// Takes over the counters of a snapshot.
    ///
    /// # Real-time
    ///
    /// Plain stores into memory that only this thread writes.
    pub fn note(&self, snapshot: &ParameterSnapshot, implausible: Option<DetectedFault>) {
        self.counters.used.store(snapshot.samples_used, Relaxed);
        self.counters.rejected.store(snapshot.samples_rejected, Relaxed);
        self.counters.lost.store(snapshot.samples_lost, Relaxed);
        self.counters.status.store(word(snapshot.status, snapshot.reason), Relaxed);
        self.counters.implausible.store(packed(implausible), Relaxed);
        for (counter, &count) in self.counters.refused.iter().zip(&snapshot.rejected_by_reason) {
            counter.store(count, Relaxed);
        }
        self.counters.suspect.note(snapshot);
        let beats = self.counters.beats.load(Relaxed).wrapping_add(1);
        self.counters.beats.store(beats, Relaxed);
    }

    /// Notes where the train is, in m; no number where it does not know.
    pub fn note_position(&self, position_m: f64) {
        self.counters.suspect.position_m.store(position_m.to_bits(), Relaxed);
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
            status: halves(status),
            implausible: unpacked(self.counters.implausible.load(Relaxed)),
            refused: std::array::from_fn(|index| self.counters.refused[index].load(Relaxed)),
            suspicion: self.counters.suspect.read(),
            position_m: f64::from_bits(self.counters.suspect.position_m.load(Relaxed)),
        }
    }
}

impl Suspect {
    fn note(&self, it: &ParameterSnapshot) {
        let single = |value: f64| (value as f32).to_bits();
        self.effect.store(word(it.suspected_effect, it.suspected_alternatives), Relaxed);
        self.evidence.store(word(single(it.suspicion_evidence), it.suspicion_age_s), Relaxed);
        let force = word(single(it.unexplained_force_n), single(it.unexplained_force_std_n));
        self.force.store(force, Relaxed);
    }

    /// The words may be of two snapshots that follow each other.
    fn read(&self) -> Option<Suspicion> {
        let single = |bits| f64::from(f32::from_bits(bits));
        let (suspected_effect, suspected_alternatives) = halves(self.effect.load(Relaxed));
        let (evidence, suspicion_age_s) = halves(self.evidence.load(Relaxed));
        let (force, force_std) = halves(self.force.load(Relaxed));
        Suspicion::of(&ParameterSnapshot {
            suspected_effect,
            suspected_alternatives,
            suspicion_age_s,
            suspicion_evidence: single(evidence),
            unexplained_force_n: single(force),
            unexplained_force_std_n: single(force_std),
            ..ParameterSnapshot::empty()
        })
    }
}

fn word(high: u32, low: u32) -> u64 {
    u64::from(high) << 32 | u64::from(low)
}

fn halves(word: u64) -> (u32, u32) {
    ((word >> 32) as u32, word as u32)
}

/// A detected fault in one word: the input fault's number, and its factor in single precision.
fn packed(detected: Option<DetectedFault>) -> u64 {
    detected.map_or(0, |it| word(u32::from(it.fault as u8), (it.factor as f32).to_bits()))
}

fn unpacked(word: u64) -> Option<DetectedFault> {
    let (fault, factor) = halves(word);
    let fault = InputFault::from_number(fault as u8)?;
    Some(DetectedFault { fault, factor: f64::from(f32::from_bits(factor)) })
}

#[cfg(test)]
mod tests {
    use dynocar_shared::RejectionReason;
    use dynocar_shared::vocabulary::EffectKind;

    use super::*;

    #[test]
    fn what_a_snapshot_refuses_and_suspects_is_read_again() {
        let tally = Tally::default();
        let mut snapshot = ParameterSnapshot::empty();
        tally.note(&snapshot, None);
        assert_eq!(tally.read().suspicion, None);
        snapshot.rejected_by_reason[RejectionReason::SpeedJump as usize] = 104;
        snapshot.suspected_effect = EffectKind::DraggingBrake as u32;
        snapshot.suspected_alternatives = EffectKind::Wind.bit();
        (snapshot.suspicion_age_s, snapshot.suspicion_evidence) = (23, 45.5);
        (snapshot.unexplained_force_n, snapshot.unexplained_force_std_n) = (-12_345.0, 512.0);
        tally.note(&snapshot, None);
        tally.note_position(3_214.0);
        let reading = tally.read();
        assert_eq!(reading.suspicion, Suspicion::of(&snapshot));
        assert_eq!(reading.refused, snapshot.rejected_by_reason);
        assert_eq!(reading.position_m, 3_214.0);
    }
}
