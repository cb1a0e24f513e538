//! Medians, quantiles, root mean squares and spans of values; lists sorted by a number.

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
