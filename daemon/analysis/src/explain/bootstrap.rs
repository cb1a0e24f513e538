//! Percentile bootstrap over runs or blocks.

use dynocar_core::filter::random::Random;

/// Draws.
const DRAWS: usize = 2000;
/// Seed of the draws, fixed so that answers repeat.
const SEED: u64 = 7;

/// Returns the 95 % intervals of some statistics by drawing the units with replacement, with the same draws for all
/// statistics; `None` with fewer than two units, and where no draw has a value.
pub fn intervals_95<T, const K: usize>(
    units: &[T],
    statistics: impl Fn(&[&T]) -> Option<[f64; K]>,
) -> Option<[[f64; 2]; K]> {
    let count = units.len();
    if count < 2 {
        return None;
    }
    let mut random = Random::new(SEED);
    let mut draw = || &units[((random.uniform() * count as f64) as usize).min(count - 1)];
    let mut drawn = Vec::with_capacity(count);
    let mut draws: [Vec<f64>; K] = std::array::from_fn(|_| Vec::with_capacity(DRAWS));
    for _ in 0..DRAWS {
        drawn.clear();
        drawn.extend((0..count).map(|_| draw()));
        for (list, value) in draws.iter_mut().zip(statistics(&drawn).into_iter().flatten()) {
            list.push(value);
        }
    }
    let interval = |mut list: Vec<f64>| {
        list.sort_unstable_by(f64::total_cmp);
        let at =
            |share: f64| list.get((list.len().checked_sub(1)? as f64 * share).round() as usize);
        Some([*at(0.025)?, *at(0.975)?])
    };
    let intervals: Vec<[f64; 2]> = draws.into_iter().filter_map(interval).collect();
    intervals.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_of_a_mean_is_as_wide_as_its_standard_error_says() {
        let units: Vec<f64> = (0..100).map(f64::from).collect();
        let mean = |drawn: &[&f64]| Some([drawn.iter().copied().sum::<f64>() / drawn.len() as f64]);
        let [[low, high]] = intervals_95(&units, mean).unwrap();
        let half = 1.96 * (f64::from(100 * 100 - 1) / 12.0 / 100.0).sqrt();
        assert!((low - (49.5 - half)).abs() < 0.5 && (high - (49.5 + half)).abs() < 0.5);
        assert_eq!(intervals_95(&units, mean), Some([[low, high]]), "the same again");
        assert_eq!(intervals_95(&[1.0], mean), None);
        assert_eq!(intervals_95(&[1.0, 2.0], |_| None::<[f64; 1]>), None);
    }
}
