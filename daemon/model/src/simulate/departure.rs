//! When a train departs.

use crate::force::ResolvedSample;
pub use crate::terms::wheel::STANDING_MPS;

/// True for the last sample of a stand: a train departs after it.
#[inline]
pub fn departs(samples: &[ResolvedSample], index: usize) -> bool {
    let stands = |at: usize| samples.get(at).is_some_and(|it| it.speed_mps <= STANDING_MPS);
    stands(index) && index + 1 < samples.len() && !stands(index + 1)
}
