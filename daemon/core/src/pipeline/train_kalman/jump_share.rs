//! How much of what forces may bring between two samples they do bring.

use super::bank::Measured;

/// Weight that the first share counts for, and what is looked back over.
const WEIGHT_FIRST: f64 = 3.0;
const WEIGHT_MAX: f64 = 300.0;
/// Share of an innovation's variance from which it says something of jumps.
const SEEN_SHARE: f64 = 0.1;
/// What a single innovation may say, and the shares that there can be.
const SEEN: (f64, f64) = (-4.0, 12.0);
const SHARES: (f64, f64) = (1e-3, 12.0);

/// The share of [`crate::pipeline::motion::jump_variance`] that the forces of a train bring, by the
/// innovations at changes of force: 1 where nobody knows when within a step a force changed, hardly
/// anything where it runs straight between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JumpShare {
    share: f64,
    weight: f64,
}

impl Default for JumpShare {
    fn default() -> Self {
        JumpShare { share: 1.0, weight: WEIGHT_FIRST }
    }
}

impl JumpShare {
    /// The share.
    pub fn share(&self) -> f64 {
        self.share
    }

    /// Takes in an innovation: its square has the mean of the rest of its variance and the share of the
    /// jump's.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn learn(&mut self, measured: &Measured) {
        let of_variance = measured.jump_variance / measured.variance;
        if !(of_variance > SEEN_SHARE * self.share.min(1.0)) {
            return;
        }
        let whole = measured.jump_variance / self.share;
        let rest = measured.variance - measured.jump_variance;
        let seen = ((measured.innovation_mps.powi(2) - rest) / whole).clamp(SEEN.0, SEEN.1);
        let weight = (whole / measured.variance).powi(2).min(1.0);
        self.weight = (self.weight + weight).min(WEIGHT_MAX);
        self.share += (seen - self.share) * weight / self.weight;
        self.share = self.share.clamp(SHARES.0, SHARES.1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::motion::Trust;

    #[test]
    fn the_share_follows_the_squares_of_the_innovations_at_changes_of_force() {
        let learned = |innovation_mps: f64| {
            let mut jumps = JumpShare::default();
            for _ in 0..2000 {
                let jump_variance = 1e-3 * jumps.share();
                jumps.learn(&Measured {
                    trust: Trust::of(0.0),
                    innovation_mps,
                    variance: 1e-3 + jump_variance,
                    jump_variance,
                });
            }
            jumps.share()
        };
        assert!((learned(2e-3_f64.sqrt()) - 1.0).abs() < 0.05);
        assert!((learned(1.5e-3_f64.sqrt()) - 0.5).abs() < 0.1);
        assert!(learned(0.0) < 0.15, "no jump at all");
    }
}
