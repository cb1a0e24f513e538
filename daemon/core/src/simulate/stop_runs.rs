//! Runs from stop to stop: from the last sample at rest to the next.

use std::ops::Range;

use super::recording::Recording;
use crate::force::ResolvedSample;

/// Up to this speed in m/s a train stands; below it a wheel sensor sees nothing.
const STANDING_MPS: f64 = 0.3;
/// A run that moves for less time in s is a shunt in a queue, and tells little.
const MOVING_MIN_S: f64 = 10.0;

/// True for the last sample of a stand: a train departs after it.
#[inline]
pub(super) fn departs(samples: &[ResolvedSample], index: usize) -> bool {
    let stands = |at: usize| samples.get(at).is_some_and(|it| it.speed_mps <= STANDING_MPS);
    stands(index) && index + 1 < samples.len() && !stands(index + 1)
}

/// The runs from stop to stop that can be simulated from departure to standstill: first sample,
/// at rest, and one past the last, at rest again.
pub fn stop_runs(recording: &Recording) -> Vec<Range<usize>> {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let mut runs = Vec::new();
    let mut from = None;
    for index in 0..samples.len() {
        let is_lost = !recording.is_simulated(index) || (index > 0 && recording.starts(index));
        if is_lost {
            from = None;
        } else if let Some(start) = from
            && samples[index].speed_mps <= STANDING_MPS
        {
            let moving = |at: &usize| samples[*at].speed_mps > STANDING_MPS;
            let moving_s: f64 =
                (start + 1..=index).filter(moving).map(|at| time_s[at] - time_s[at - 1]).sum();
            if moving_s >= MOVING_MIN_S {
                runs.push(start..index + 1);
            }
            from = None;
        }
        if departs(samples, index) && recording.is_simulated(index) {
            from = Some(index);
        }
    }
    runs
}
