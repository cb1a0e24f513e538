//! Outliers among neighbouring values.

/// Quantile of the differences that counts as the spread of a run's values around their neighbours: above the median,
/// since a centre that is itself the median does not differ, and low enough for one value in ten, with its neighbours,
/// to be an outlier.
const SPREAD_QUANTILE: f64 = 0.75;
/// Least size of a spike in spreads; about eight standard deviations of white noise.
const SPIKE_SPREADS: f64 = 8.0;

/// Marks values that differ much from the median of the `N` around them (Hampel's filter, with the spread taken over
/// the whole run). `N` is odd: with 5, up to two rows in a row can be detected, with 3 a single one.
///
/// Only rows marked in `usable` and not `NaN` take part; the first and last few have too few
/// neighbours to be detected. `least` is the difference below which nothing is a spike.
pub(super) fn spikes<const N: usize>(values: &[f64], usable: &[bool], least: f64) -> Vec<bool> {
    let mut marks = vec![false; values.len()];
    let rows = (0..values.len()).filter(|&row| usable[row] && !values[row].is_nan());
    // Differences up to this neither are spikes nor raise the bound.
    let small = least / SPIKE_SPREADS;
    let mut large: Vec<(usize, f64)> = Vec::new();
    let mut window = [(0, 0.0); N];
    let mut windows = 0_usize;
    for (count, row) in rows.enumerate() {
        window.copy_within(1.., 0);
        window[N - 1] = (row, values[row]);
        if count + 1 < N {
            continue;
        }
        windows += 1;
        let (centre, value) = window[N / 2];
        let difference = (value - median(window.map(|(_, value)| value))).abs();
        if difference > small {
            large.push((centre, difference));
        }
    }
    let rank = (SPREAD_QUANTILE * windows as f64) as usize + large.len();
    let spread = match rank.checked_sub(windows).filter(|&rank| rank < large.len()) {
        Some(rank) => {
            large.select_nth_unstable_by(rank, |one, other| one.1.total_cmp(&other.1)).1.1
        }
        None => 0.0,
    };
    let bound = least.max(SPIKE_SPREADS * spread);
    for (row, difference) in large {
        marks[row] = difference > bound;
    }
    marks
}

/// The median of numbers, sorted by exchanging neighbours, without a branch.
fn median<const N: usize>(mut values: [f64; N]) -> f64 {
    for end in (1..N).rev() {
        for place in 0..end {
            let (one, other) = (values[place], values[place + 1]);
            values[place] = if one < other { one } else { other };
            values[place + 1] = if one < other { other } else { one };
        }
    }
    values[N / 2]
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
