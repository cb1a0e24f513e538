//! Values that stick out from their neighbours.

use super::order::quantile;

/// The spread of a run's values around their neighbours is this quantile of the differences:
/// above the median, since a centre that is itself the median differs by nothing, and
/// low enough for one value in ten, with its neighbours, to be an outlier.
const SPREAD_QUANTILE: f64 = 0.75;
/// So many spreads make a spike; about eight standard deviations of white noise.
const SPIKE_SPREADS: f64 = 8.0;

/// Marks values that stick out from the median of the `N` around them (Hampel's filter, with
/// the spread taken over the whole run). `N` is odd: with 5, up to two rows in a row can be detected,
/// with 3 a single one.
///
/// Only rows marked in `usable` and not `NaN` take part; the first and last few have too few
/// neighbours to be detected. `least` is the difference below which nothing is a spike.
pub(super) fn spikes<const N: usize>(values: &[f64], usable: &[bool], least: f64) -> Vec<bool> {
    let mut marks = vec![false; values.len()];
    let rows: Vec<usize> =
        (0..values.len()).filter(|&row| usable[row] && !values[row].is_nan()).collect();
    let difference = |window: &[usize]| {
        let mut around = [0.0; N];
        for (slot, &row) in around.iter_mut().zip(window) {
            *slot = values[row];
        }
        around.sort_unstable_by(f64::total_cmp);
        (values[window[N / 2]] - around[N / 2]).abs()
    };
    let differences: Vec<f64> = rows.windows(N).map(difference).collect();
    let spread = quantile(differences.clone(), SPREAD_QUANTILE).unwrap_or(0.0);
    let bound = least.max(SPIKE_SPREADS * spread);
    for (difference, window) in differences.iter().zip(rows.windows(N)) {
        marks[window[N / 2]] = *difference > bound;
    }
    marks
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marked(values: &[f64], least: f64) -> Vec<usize> {
        let marks = spikes::<5>(values, &vec![true; values.len()], least);
        (0..values.len()).filter(|&row| marks[row]).collect()
    }

    #[test]
    fn a_spike_is_marked_and_a_step_is_not() {
        let mut values: Vec<f64> = (0..40).map(|i| if i < 20 { 1.0 } else { 50.0 }).collect();
        values[10] = 30.0;
        values[30] = f64::NAN;
        assert_eq!(marked(&values, 0.5), [10]);
    }

    #[test]
    fn two_spikes_in_a_row_are_both_marked() {
        let mut values = vec![5.0; 20];
        (values[8], values[9]) = (90.0, 90.0);
        assert_eq!(marked(&values, 0.5), [8, 9]);
        assert!(spikes::<3>(&values, &[true; 20], 0.5).iter().all(|&mark| !mark));
    }

    #[test]
    fn noise_and_ramps_hold_no_spikes() {
        let values: Vec<f64> =
            (0..200).map(|i| 0.3 * f64::from(i) + 0.4 * f64::from(i * 7919 % 13) / 13.0).collect();
        assert_eq!(marked(&values, 0.01), [] as [usize; 0]);
    }

    #[test]
    fn rows_that_are_not_usable_are_no_neighbours() {
        let values = [1.0, 1.0, 900.0, 900.0, 900.0, 1.0, 1.0, 1.0, 1.0];
        let usable = [true, true, false, false, false, true, true, true, true];
        assert!(spikes::<5>(&values, &usable, 0.5).iter().all(|&mark| !mark));
    }
}
