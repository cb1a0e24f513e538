//! When a train departs.

use crate::force::ResolvedSample;

/// Up to this speed in m/s a train stands; below it a wheel sensor sees nothing.
pub const STANDING_MPS: f64 = 0.3;

/// True for the last sample of a stand: a train departs after it.
#[inline]
pub fn departs(samples: &[ResolvedSample], index: usize) -> bool {
    let stands = |at: usize| samples.get(at).is_some_and(|it| it.speed_mps <= STANDING_MPS);
    stands(index) && index + 1 < samples.len() && !stands(index + 1)
}
