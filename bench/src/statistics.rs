//! Means, quantiles and differences over seeded runs.

use std::borrow::Borrow;

/// m/s of one km/h.
pub const KMH: f64 = 1.0 / 3.6;

/// Returns the arithmetic mean; 0 for no values.
pub fn mean(values: impl IntoIterator<Item: Borrow<f64>>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for value in values {
        sum += value.borrow();
        count += 1;
    }
    if count == 0 { 0.0 } else { sum / f64::from(count) }
}

/// Returns the share of true values; 0 for no values.
pub fn share(are_so: impl IntoIterator<Item = bool>) -> f64 {
    mean(are_so.into_iter().map(|is_so| f64::from(u8::from(is_so))))
}

/// Returns the root mean square; 0 for no values.
pub fn root_mean_square(values: impl IntoIterator<Item: Borrow<f64>>) -> f64 {
    mean(values.into_iter().map(|value| value.borrow() * value.borrow())).sqrt()
}

/// Returns the values that these shares of all values do not exceed; `None` for no values.
pub fn quantiles<const N: usize>(mut values: Vec<f64>, shares: [f64; N]) -> Option<[f64; N]> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)? as f64;
    Some(shares.map(|share| values[(share * last).round() as usize]))
}

/// Returns the middle of some values, of two the greater one; none of none.
pub fn median(values: Vec<f64>) -> Option<f64> {
    quantiles(values, [0.5]).map(|[middle]| middle)
}

/// Returns a straight line through some points, by least squares: its value at 0, and its slope.
pub fn straight_line(points: &[(f64, f64)]) -> (f64, f64) {
    let (mean_x, mean_y) = (mean(points.iter().map(|it| it.0)), mean(points.iter().map(|it| it.1)));
    let spread: f64 = points.iter().map(|it| (it.0 - mean_x).powi(2)).sum();
    let slope = points.iter().map(|it| (it.0 - mean_x) * (it.1 - mean_y)).sum::<f64>() / spread;
    (mean_y - slope * mean_x, slope)
}

/// Derivatives of every element of a list with respect to each parameter, by central differences of these widths: from
/// the motion of a scenario, independently of the derivatives that estimators use.
pub fn jacobian<const N: usize>(
    widths: [f64; N],
    at: impl Fn([f64; N]) -> Vec<f64>,
) -> Vec<[f64; N]> {
    let mut rows = Vec::new();
    for (column, width) in widths.into_iter().enumerate() {
        let mut change = [0.0; N];
        change[column] = width;
        let (plus, minus) = (at(change), at(change.map(|width| -width)));
        rows.resize(plus.len().max(rows.len()), [0.0; N]);
        for (row, (plus, minus)) in rows.iter_mut().zip(plus.iter().zip(minus)) {
            row[column] = (plus - minus) / (2.0 * width);
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_and_quantiles_of_a_small_set() {
        assert_eq!(root_mean_square([3.0, -4.0]), 12.5_f64.sqrt());
        assert_eq!((mean([1.0, 2.0, 6.0]), mean(&[] as &[f64])), (3.0, 0.0));
        assert_eq!(share([true, false, true, true]), 0.75);
        assert_eq!(straight_line(&[(1.0, 3.0), (2.0, 5.0), (4.0, 9.0)]), (1.0, 2.0));
        let found = quantiles(vec![5.0, 1.0, 100.0, 2.0, 3.0], [0.25, 0.5, 0.75]);
        assert_eq!(found, Some([2.0, 3.0, 5.0]));
        assert_eq!((median(vec![3.0, 1.0, 10.0, 2.0]), median(Vec::new())), (Some(3.0), None));
    }
}
