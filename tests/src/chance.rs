//! Random numbers of simulators and measurements: the same for the same seed, on every machine.

use std::f64::consts::TAU;

use rand::distr::uniform::{SampleRange, SampleUniform};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A source of random numbers.
#[derive(Clone, Debug)]
pub struct Chance(ChaCha8Rng);

impl Chance {
    /// Returns the source of a seed.
    pub fn new(seed: u64) -> Self {
        Chance(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Returns one of many independent sources of a seed, by its number; [`Chance::new`] has number 0.
    pub fn of_stream(seed: u64, number: u64) -> Self {
        let mut chance = Chance::new(seed);
        chance.0.set_stream(number);
        chance
    }

    /// Returns a number drawn uniformly from 0 to 1.
    pub fn uniform(&mut self) -> f64 {
        self.0.random()
    }

    /// Returns a number drawn uniformly from `low` to `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Returns a number drawn uniformly from -1 to 1.
    pub fn either_way(&mut self) -> f64 {
        2.0 * self.uniform() - 1.0
    }

    /// Returns two independent numbers drawn from the standard normal distribution (Box-Muller).
    pub fn normal_pair(&mut self) -> [f64; 2] {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let (sine, cosine) = (TAU * self.uniform()).sin_cos();
        [radius * cosine, radius * sine]
    }

    /// Returns a number drawn from the standard normal distribution.
    pub fn normal(&mut self) -> f64 {
        self.normal_pair()[0]
    }

    /// 1 or -1.
    pub fn sign(&mut self) -> f64 {
        if self.0.random() { 1.0 } else { -1.0 }
    }

    /// Returns a whole number of a range.
    pub fn within<T: SampleUniform>(&mut self, range: impl SampleRange<T>) -> T {
        self.0.random_range(range)
    }

    /// Returns the numbers from 0 to `count - 1` in random order.
    pub fn order(&mut self, count: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..count).collect();
        order.shuffle(&mut self.0);
        order
    }
}
