//! Probability that a brake of many units is weak, by importance sampling: down to one stop in 10⁹.
//!
//! A stop's deceleration over the nominal one is the mean over the units of (1 + friction)(1 + pressure)(1 +
//! efficiency), 0 for a unit that failed, times (1 + common) / (1 + mass). For each level the draws are tilted
//! exponentially towards that level, by the saddle point of the first-order sum, and weighted back (Siegmund 1976;
//! Bucklew 2004, chapter 5): the weights are exact, although the tilt is approximate.

use dynocar_model::train::BrakeComponents;
use dynocar_shared::quantile::normal_quantile;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::parallel::of_each_number;

/// Number of draws of one stream of random numbers.
const BLOCK: usize = 1024;
/// Greatest tilt in inverse standard deviations.
const TILT_MAX: f64 = 60.0;

/// Share of the nominal deceleration that all stops but a given fraction reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weakest {
    /// The share.
    pub share: f64,
    /// Relative standard deviation of the probability that was sampled at it.
    pub error: f64,
    /// Number of draws without tilt that would have the same variance, as a multiple of the draws.
    pub gain: f64,
}

/// Tilt of the draws towards weak stops.
#[derive(Clone, Copy)]
struct Tilt {
    /// Failure probability of a unit.
    failure: f64,
    /// Means of the normals of a unit: friction, pressure, efficiency.
    unit: [f64; 3],
    /// Means of the normals of the train: common, mass.
    train: [f64; 2],
}

/// Returns the share that all stops but `probability` of them reach, from a number of draws with a seed.
pub fn weakest(brake: &BrakeComponents, probability: f64, draws: usize, seed: u64) -> Weakest {
    sampled(brake, probability, Tilt::towards(brake, probability), (draws, seed))
}

/// Returns the same without tilt.
pub fn weakest_plain(
    brake: &BrakeComponents,
    probability: f64,
    draws: usize,
    seed: u64,
) -> Weakest {
    sampled(brake, probability, Tilt::by(brake, 0.0), (draws, seed))
}

fn sampled(
    brake: &BrakeComponents,
    probability: f64,
    tilt: Tilt,
    (draws, seed): (usize, u64),
) -> Weakest {
    let blocks = of_each_number(draws.div_ceil(BLOCK), |block| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(block as u64);
        (0..BLOCK).map(|_| tilt.draw(brake, &mut random)).collect::<Vec<(f64, f64)>>()
    });
    let mut drawn = blocks.concat();
    drawn.sort_by(|one, other| one.0.total_cmp(&other.0));
    let count = drawn.len() as f64;
    let (mut below, mut squares, mut share) = (0.0, 0.0, 0.0);
    for (at, weight) in drawn {
        (below, squares, share) = (below + weight, squares + weight * weight, at);
        if below > probability * count {
            break;
        }
    }
    let reached = (below / count).max(f64::MIN_POSITIVE);
    let variance = (squares / count - reached * reached).max(0.0);
    let error = (variance / count).sqrt() / reached;
    let gain = reached * (1.0 - reached).max(0.0) / variance.max(f64::MIN_POSITIVE);
    Weakest { share, error, gain }
}

impl Tilt {
    /// Returns the tilt under which stops as weak as the probability says are usual.
    fn towards(brake: &BrakeComponents, probability: f64) -> Self {
        let (mut low, mut high) = (-TILT_MAX * spread_inverse(brake), 0.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if tail(brake, middle) < probability { low = middle } else { high = middle }
        }
        Tilt::by(brake, high)
    }

    fn by(brake: &BrakeComponents, tilt: f64) -> Self {
        let each = tilt / f64::from(brake.units);
        let stds = [brake.friction_std, brake.pressure_std, brake.efficiency_std];
        Tilt {
            failure: unit(brake, tilt)[1],
            unit: stds.map(|std| each * std),
            train: [tilt * brake.common_std, -tilt * brake.mass_std],
        }
    }

    /// Returns a stop's deceleration over the nominal one, and the weight of the draw.
    fn draw(&self, brake: &BrakeComponents, random: &mut ChaCha8Rng) -> (f64, f64) {
        let mut uniform = || (random.next_u64() >> 11) as f64 * 2f64.powi(-53) + 2f64.powi(-54);
        let mut log_weight = 0.0;
        let mut differs = |std: f64, mean: f64, at: f64| {
            if std == 0.0 {
                return 1.0;
            }
            let normal = mean + normal_quantile(at).unwrap_or(0.0);
            log_weight += mean * (0.5 * mean - normal);
            1.0 + std * normal
        };
        let common = differs(brake.common_std, self.train[0], uniform());
        let mass = differs(brake.mass_std, self.train[1], uniform());
        let (mut sum, mut failed) = (0.0, 0);
        for _ in 0..brake.units {
            if self.failure > 0.0 && uniform() < self.failure {
                failed += 1;
                continue;
            }
            sum += differs(brake.friction_std, self.unit[0], uniform())
                * differs(brake.pressure_std, self.unit[1], uniform())
                * differs(brake.efficiency_std, self.unit[2], uniform());
        }
        if self.failure > 0.0 {
            let dead = (brake.failure_probability / self.failure).ln();
            let alive = ((1.0 - brake.failure_probability) / (1.0 - self.failure)).ln();
            log_weight += f64::from(failed) * dead + f64::from(brake.units - failed) * alive;
        }
        let share = sum / f64::from(brake.units) * common / mass.max(0.1);
        (share.max(0.0), log_weight.exp())
    }
}

/// Under a tilt: the logarithm of a unit's exponential moment, the share of it that failed units have, and its
/// derivative.
fn unit(brake: &BrakeComponents, tilt: f64) -> [f64; 3] {
    let each = tilt / f64::from(brake.units);
    let variance =
        brake.friction_std.powi(2) + brake.pressure_std.powi(2) + brake.efficiency_std.powi(2);
    let alive = (-brake.failure_probability).ln_1p() + each + 0.5 * each * each * variance;
    let failed = brake.failure_probability.ln();
    let most = alive.max(failed);
    let log = most + ((alive - most).exp() + (failed - most).exp()).ln();
    [log, (failed - log).exp(), (alive - log).exp() * (1.0 + each * variance)]
}

/// Returns the logarithm of the moments of the sum, its mean under a tilt and its variance there.
fn cumulants(brake: &BrakeComponents, tilt: f64) -> [f64; 3] {
    let train = brake.common_std.powi(2) + brake.mass_std.powi(2);
    let [log, _, slope] = unit(brake, tilt);
    let step = 1e-4 * (1.0 + tilt.abs());
    let [_, _, ahead] = unit(brake, tilt + step);
    let [_, _, behind] = unit(brake, tilt - step);
    let variance = train + ((ahead - behind) / (2.0 * step)).max(0.0);
    [f64::from(brake.units) * log + 0.5 * tilt * tilt * train, slope + tilt * train, variance]
}

/// Returns the probability of stops weaker than the mean under a tilt below 0 (saddle point).
fn tail(brake: &BrakeComponents, tilt: f64) -> f64 {
    let [log, mean, variance] = cumulants(brake, tilt);
    let width = (1.0 + std::f64::consts::TAU * tilt * tilt * variance).sqrt();
    (log - tilt * mean).exp() / width.max(1.0)
}

fn spread_inverse(brake: &BrakeComponents) -> f64 {
    let variance = cumulants(brake, 0.0)[2];
    1.0 / variance.sqrt().max(1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: BrakeComponents = BrakeComponents {
        units: 1,
        friction_std: 0.0,
        pressure_std: 0.0,
        efficiency_std: 0.0,
        common_std: 0.0,
        mass_std: 0.0,
        failure_probability: 0.0,
    };

    #[test]
    fn units_that_only_differ_give_the_normal_quantile() {
        let brake = BrakeComponents { units: 24, friction_std: 0.1, ..NONE };
        for level in 1..=9 {
            let probability = 0.1_f64.powi(level);
            let exact = 1.0 + normal_quantile(probability).unwrap() * 0.1 / 24_f64.sqrt();
            let found = weakest(&brake, probability, 1 << 14, 1);
            assert!((found.share / exact - 1.0).abs() < 0.003, "{level}: {found:?}, {exact}");
            let common = BrakeComponents { common_std: 0.03, ..NONE };
            let exact = 1.0 + normal_quantile(probability).unwrap() * 0.03;
            let found = weakest(&common, probability, 1 << 14, 1);
            assert!((found.share / exact - 1.0).abs() < 0.01, "{level}: {found:?}, {exact}");
        }
    }

    #[test]
    fn units_that_only_fail_give_the_binomial_quantile() {
        for (units, failure) in [(1, 2e-3), (1, 2e-8), (8, 2e-3), (40, 0.01), (40, 2e-4)] {
            let brake = BrakeComponents { units, failure_probability: failure, ..NONE };
            for level in 1..=9 {
                let probability = 0.1_f64.powi(level);
                // The most failures that are not rarer than the level.
                let exceed = |failed: u32| -> f64 {
                    let each = |k: u32| {
                        let choose = (0..k).map(|i| f64::from(units - i) / f64::from(i + 1));
                        let rest = i32::try_from(units - k).unwrap();
                        choose.product::<f64>()
                            * failure.powf(f64::from(k))
                            * (1.0 - failure).powi(rest)
                    };
                    (failed..=units).map(each).sum()
                };
                let failed = (0..=units).rev().find(|k| exceed(*k) > probability).unwrap();
                let exact = f64::from(units - failed) / f64::from(units);
                let found = weakest(&brake, probability, 1 << 14, 2);
                assert!(
                    (found.share - exact).abs() < 1e-9,
                    "{units} {failure} {level}: {found:?}, {exact}"
                );
            }
        }
    }

    #[test]
    fn tilted_draws_are_worth_a_hundred_plain_ones() {
        let brake = BrakeComponents {
            units: 24,
            friction_std: 0.06,
            pressure_std: 0.02,
            efficiency_std: 0.02,
            common_std: 0.02,
            mass_std: 0.01,
            failure_probability: 1e-3,
        };
        // By turns where plain draws still see something...
        let tilted = weakest(&brake, 1e-3, 1 << 14, 3);
        let plain = weakest_plain(&brake, 1e-3, 1 << 20, 4);
        assert!((tilted.share / plain.share - 1.0).abs() < 0.004, "{tilted:?} {plain:?}");
        // ... and by the variance of their weights where they do not.
        for level in 6..=9 {
            let found = weakest(&brake, 0.1_f64.powi(level), 1 << 14, 3);
            let again = weakest(&brake, 0.1_f64.powi(level), 1 << 14, 5);
            assert!(found.gain > 100.0 && found.error < 0.1, "{level}: {found:?}");
            assert!((found.share / again.share - 1.0).abs() < 0.01, "{found:?} {again:?}");
        }
    }
}
