//! How much wider the intervals must be when disturbances last.
//!
//! Gradient errors, wind and force errors last for tens of seconds; the learned noise is white.
//! Sums of normalised innovations over blocks show what that leaves out: their mean square over
//! the block's length is 1 for white innovations and the long-run variance otherwise. The
//! estimate is nearly linear in the innovations with weights that change slowly, so that its
//! covariance grows by the same factor (Newey, West 1987, with a flat kernel over blocks).

/// Time in s of a block.
const BLOCK_S: f64 = 30.0;
/// Blocks before the mean counts.
const BLOCKS_MIN: f64 = 8.0;
/// Standard deviations by which the mean must exceed 1 to count.
const SIGNIFICANCE: f64 = 1.0;
/// A block counts for no more than this, so that one jump does not widen the intervals for long.
const BLOCK_SQUARE_MAX: f64 = 25.0;

/// Mean square of block sums of normalised innovations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LongRunVariance {
    memory: f64,
    sum: f64,
    count: f64,
    time_s: f64,
    mean_square: f64,
    blocks: f64,
}

impl LongRunVariance {
    /// A mean that looks back over so many blocks; infinity for all of them.
    pub fn new(memory_blocks: f64) -> Self {
        LongRunVariance {
            memory: memory_blocks,
            sum: 0.0,
            count: 0.0,
            time_s: 0.0,
            mean_square: 0.0,
            blocks: 0.0,
        }
    }

    /// Takes in a normalised innovation after a step of a given time.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn push(&mut self, normalised: f64, duration_s: f64) {
        self.sum += normalised;
        self.count += 1.0;
        self.time_s += duration_s;
        if self.time_s < BLOCK_S {
            return;
        }
        let square = (self.sum * self.sum / self.count).min(BLOCK_SQUARE_MAX);
        self.blocks = (self.blocks + 1.0).min(self.memory);
        self.mean_square += (square - self.mean_square) / self.blocks;
        self.break_here();
    }

    /// Forgets the block that is being filled, so that none reaches across a gap.
    pub fn break_here(&mut self) {
        self.sum = 0.0;
        self.count = 0.0;
        self.time_s = 0.0;
    }

    /// Factor on the covariance, at least 1.
    pub fn inflation(&self) -> f64 {
        let chance = 1.0 + SIGNIFICANCE * (2.0 / self.blocks.max(1.0)).sqrt();
        if self.blocks >= BLOCKS_MIN && self.mean_square > chance { self.mean_square } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// Twelve uniforms: mean 0, variance 1.
    fn normal(random: &mut rand_chacha::ChaCha8Rng) -> f64 {
        (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
    }

    #[test]
    fn white_innovations_widen_nothing_and_lasting_ones_do() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut white = LongRunVariance::new(60.0);
        let mut lasting = LongRunVariance::new(60.0);
        let mut level = 0.0;
        for _ in 0..20_000 {
            let shock = normal(&mut random);
            white.push(shock, 0.2);
            level = 0.8 * level + 0.6 * shock;
            lasting.push(level, 0.2);
        }
        assert_eq!(white.inflation(), 1.0);
        // (1 + 0.8) / (1 - 0.8) for an autoregression of 0.8.
        assert!((6.0..12.0).contains(&lasting.inflation()), "{}", lasting.inflation());
    }

    #[test]
    fn a_gap_drops_the_open_block() {
        let mut variance = LongRunVariance::new(60.0);
        for _ in 0..100 {
            variance.push(1.0, 29.0);
            variance.break_here();
        }
        assert_eq!(variance.inflation(), 1.0);
    }
}
