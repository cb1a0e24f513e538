//! Medians, quantiles, root mean squares and spans of values, and their intervals by bootstrap; lists sorted by a
//! number.

use dynocar_core::filter::random::Random;

/// Draws of a percentile bootstrap.
const BOOTSTRAP_DRAWS: usize = 2000;
/// Seed of the draws, fixed so that answers repeat.
const BOOTSTRAP_SEED: u64 = 7;

/// Returns the middle of some values, the upper one of two; `None` without values.
pub fn middle(values: &mut [f64]) -> Option<f64> {
    let index = values.len() / 2;
    match values {
        [] => None,
        values => Some(*values.select_nth_unstable_by(index, f64::total_cmp).1),
    }
}

/// Returns the middle of some values, the mean of two; `None` without values.
pub fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some(0.5 * (values[last / 2] + values[values.len() / 2]))
}

/// Returns the value below which a share of some values lies; 0 without values.
pub fn share_of(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let index = (share * sorted.len().saturating_sub(1) as f64) as usize;
    sorted.get(index).copied().unwrap_or(0.0)
}

/// Returns the root mean square; 0 without values.
pub fn rms(values: &[f64]) -> f64 {
    let squares: f64 = values.iter().map(|value| value * value).sum();
    (squares / values.len().max(1) as f64).sqrt()
}

/// Returns the least and greatest of some values; `None` of none.
pub fn span(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let ends = values.map(|value| [value; 2]);
    ends.reduce(|[low, high], [value, _]| [low.min(value), high.max(value)])
}

/// Sorts a list by a number, the greatest first; items with the same number keep their order.
pub fn greatest_first<T>(list: &mut Vec<T>, number: impl Fn(&T) -> f64) {
    least_first(list, |it| -number(it));
}

/// Sorts a list by a number, the least first; items with the same number keep their order.
pub fn least_first<T>(list: &mut Vec<T>, number: impl Fn(&T) -> f64) {
    let order = order(&list.iter().map(number).collect::<Vec<f64>>());
    let mut items: Vec<Option<T>> = std::mem::take(list).into_iter().map(Some).collect();
    list.extend(order.into_iter().filter_map(|index| items[index].take()));
}

/// Returns the indices of numbers from the least to the greatest.
fn order(numbers: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..numbers.len()).collect();
    order.sort_by(|&one, &other| numbers[one].total_cmp(&numbers[other]));
    order
}

/// Returns the 95 % intervals of some statistics by a percentile bootstrap: the units are drawn with replacement, with
/// the same draws for all statistics; `None` with fewer than two units, and where no draw has a value.
pub fn intervals_95<T, const K: usize>(
    units: &[T],
    statistics: impl Fn(&[&T]) -> Option<[f64; K]>,
) -> Option<[[f64; 2]; K]> {
    let count = units.len();
    if count < 2 {
        return None;
    }
    let mut random = Random::new(BOOTSTRAP_SEED);
    let mut draw = || &units[((random.uniform() * count as f64) as usize).min(count - 1)];
    let mut drawn = Vec::with_capacity(count);
    let mut draws: [Vec<f64>; K] = std::array::from_fn(|_| Vec::with_capacity(BOOTSTRAP_DRAWS));
    for _ in 0..BOOTSTRAP_DRAWS {
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
