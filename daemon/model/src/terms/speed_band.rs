//! A force by a law of the speed that no term follows: bands of speed, with a force of its own in each.
//!
//! If a force depends on the speed in a way that a, b, c do not follow, then some band holds more or less of it than
//! its neighbours. One band alone is no law, but it describes such a force better than a wind or a brake does: a force
//! that a band explains best has no name.

use dynocar_shared::vocabulary::EffectKind;

use super::{Suspect, SuspectInput};

/// Speed in m/s from the middle of a band to the middle of its neighbour, where the band ends.
const WIDTH_MPS: f64 = 7.5;

/// Returns the share of a band that a speed lies in; bands add up to 1 everywhere, the last has no end.
fn share(band: usize, speed_mps: f64) -> f64 {
    let place = speed_mps / WIDTH_MPS - band as f64;
    if band + 1 == BANDS.len() && place > 0.0 { 1.0 } else { (1.0 - place.abs()).max(0.0) }
}

/// A suspect whose unit is 1 N/kN in a band.
const fn of(unit: fn(&SuspectInput) -> f64) -> Suspect {
    Suspect::new(EffectKind::Unknown, 1.0, unit)
}

/// From standing to fast.
pub const BANDS: [Suspect; 5] = [
    of(|seen| share(0, seen.speed_mps)),
    of(|seen| share(1, seen.speed_mps)),
    of(|seen| share(2, seen.speed_mps)),
    of(|seen| share(3, seen.speed_mps)),
    of(|seen| share(4, seen.speed_mps)),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_add_up_to_one_at_every_speed() {
        for tenths in 0..1000 {
            let speed_mps = 0.1 * f64::from(tenths);
            let sum: f64 = (0..BANDS.len()).map(|band| share(band, speed_mps)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{speed_mps} m/s: {sum}");
        }
    }
}
