//! The physical terms of the model: one file holds one law with its numbers.
//!
//! A term defines the effect of its numbers on the forces at a sample, their keys in `train.toml` or `track.toml`, the
//! bounds within which they make sense, the least size that counts, and the effect of one unit where the monitor looks
//! for it. The daemon's forces, `explain`, the monitor, the simulator and the writer of the updated model all take the
//! law from here, so that the law found and the law applied are the same, to the bit.

pub mod adhesion;
pub mod ambient;
pub mod bearings;
pub mod brake;
pub mod curve;
pub mod delay;
pub mod extra;
pub mod gradient;
mod key;
pub mod masses;
pub mod place;
mod resistance;
pub mod rotating;
pub mod speed_band;
pub mod speed_delay;
pub mod traction;
pub mod tunnel;
pub mod wheel;
pub mod wind;

pub use crate::train::numbers::Key;
pub use key::{Least, ModelEntry, Parameter, Suspect, SuspectInput};
pub use resistance::Resistance;

/// Suspects of the monitor, one column of its regression each.
pub const SUSPECTS: [Suspect; 8] = [
    tunnel::SUSPECT,
    wind::SUSPECT,
    masses::SUSPECT,
    rotating::SUSPECT,
    ambient::SUSPECT,
    place::SUSPECT,
    gradient::SUSPECT,
    adhesion::SUSPECT,
];

/// Suspects that are never known exactly, so that the monitor learns them in any case: only an unusual value is an
/// effect.
pub const USUAL: [Suspect; 4] =
    [masses::SUSPECT, wind::OF_THE_DAY, curve::SUSPECT, bearings::SUSPECT];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_terms_claim_a_suspicion() {
        for (k, suspect) in SUSPECTS.iter().enumerate() {
            assert!(SUSPECTS[..k].iter().all(|other| other.effect != suspect.effect));
        }
    }
}
