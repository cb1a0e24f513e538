//! Means, quantiles and random numbers over seeded runs.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// m/s of one km/h.
pub const KMH: f64 = 1.0 / 3.6;

/// Arithmetic mean; 0 of none.
pub fn mean(values: &[f64]) -> f64 {
    if values.is_empty() { 0.0 } else { values.iter().sum::<f64>() / values.len() as f64 }
}

/// Root mean square; 0 of none.
pub fn root_mean_square(values: &[f64]) -> f64 {
    let squares: Vec<f64> = values.iter().map(|value| value * value).collect();
    mean(&squares).sqrt()
}

/// The values that these shares of all do not exceed; none of none.
pub fn quantiles<const N: usize>(mut values: Vec<f64>, shares: [f64; N]) -> Option<[f64; N]> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)? as f64;
    Some(shares.map(|share| values[(share * last).round() as usize]))
}

/// The middle of some values, of two the greater one; none of none.
pub fn median(values: Vec<f64>) -> Option<f64> {
    quantiles(values, [0.5]).map(|[middle]| middle)
}

/// A standard normal number.
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.random::<f64>()).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_and_quantiles_of_a_small_set() {
        assert_eq!(root_mean_square(&[3.0, -4.0]), 12.5_f64.sqrt());
        assert_eq!((mean(&[1.0, 2.0, 6.0]), mean(&[])), (3.0, 0.0));
        let found = quantiles(vec![5.0, 1.0, 100.0, 2.0, 3.0], [0.25, 0.5, 0.75]);
        assert_eq!(found, Some([2.0, 3.0, 5.0]));
        assert_eq!((median(vec![3.0, 1.0, 10.0, 2.0]), median(Vec::new())), (Some(3.0), None));
    }
}
