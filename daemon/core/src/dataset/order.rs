//! The rows' order in time: what is out of order, repeated or missing.

use serde::Serialize;

/// A step ahead in time of more than this many s is a clock set, not a gap in the rows; the
/// same bound as in [`crate::validation::ValidationLimits`].
const CLOCK_JUMP_S: f64 = 86_400.0;
/// A step longer than this many medians is a gap.
const GAP_STEPS: f64 = 1.5;
/// In rows without a regular step, a step longer than this many medians is a gap.
const IRREGULAR_GAP_STEPS: f64 = 5.0;
/// Share of steps within a quarter of the median that makes the rows regular.
const REGULAR_SHARE: f64 = 0.8;

/// The rows of a run in time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TimeOrder {
    /// True for the rows of the longest selection whose time grows.
    pub in_order: Vec<bool>,
    /// Rows missing before each row, by the time that passed.
    pub missing_before: Vec<u64>,
    /// The counts.
    pub counts: OrderCounts,
}

/// How regular the rows of a run are in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct OrderCounts {
    /// Median time step in s; 0 with fewer than two rows in order.
    pub step_s: f64,
    /// True when most steps are alike, so that missing rows can be told.
    pub is_regular: bool,
    /// Rows that must be taken out, besides repeated ones, for the time to grow.
    pub out_of_order: usize,
    /// Rows with the time of a row before them.
    pub repeated: usize,
    /// Steps longer than rows without a gap have.
    pub gaps: usize,
    /// Longest gap in s; 0 without one.
    pub longest_gap_s: f64,
    /// Rows missing in the gaps; counted when the rows are regular.
    pub missing_rows: u64,
}

impl TimeOrder {
    /// Looks at the rows' times in s, all finite.
    pub fn of(times_s: &[f64]) -> Self {
        let in_order = longest_increasing(times_s);
        let ordered: Vec<usize> = (0..times_s.len()).filter(|&row| in_order[row]).collect();
        let mut counts = OrderCounts::default();
        for (row, time) in times_s.iter().enumerate() {
            if !in_order[row] {
                let at = ordered.binary_search_by(|&other| times_s[other].total_cmp(time));
                match at {
                    Ok(_) => counts.repeated += 1,
                    Err(_) => counts.out_of_order += 1,
                }
            }
        }
        let steps: Vec<f64> =
            ordered.windows(2).map(|pair| times_s[pair[1]] - times_s[pair[0]]).collect();
        counts.step_s = quantile(steps.clone(), 0.5).unwrap_or(0.0);
        let alike = |step: &&f64| (**step - counts.step_s).abs() <= 0.25 * counts.step_s;
        let alike = steps.iter().filter(alike).count();
        counts.is_regular = alike as f64 >= REGULAR_SHARE * steps.len() as f64;
        let mut missing_before = vec![0; times_s.len()];
        for (pair, &step_s) in ordered.windows(2).zip(&steps) {
            if !counts.is_gap(step_s) {
                continue;
            }
            counts.gaps += 1;
            counts.longest_gap_s = counts.longest_gap_s.max(step_s);
            if counts.is_regular && step_s <= CLOCK_JUMP_S {
                let missing = ((step_s / counts.step_s).round() - 1.0).max(0.0) as u64;
                missing_before[pair[1]] = missing;
                counts.missing_rows += missing;
            }
        }
        TimeOrder { in_order, missing_before, counts }
    }
}

impl OrderCounts {
    /// True when rows are missing within a step of so many s.
    pub fn is_gap(&self, step_s: f64) -> bool {
        let steps = if self.is_regular { GAP_STEPS } else { IRREGULAR_GAP_STEPS };
        step_s > steps * self.step_s
    }
}

/// Marks a longest selection of strictly increasing values; of several the one that takes the
/// earliest rows, since those are what a reader from the top would keep.
///
/// Patience sorting (Fredman 1975) from the end, n log n; one pass when all increase.
fn longest_increasing(values: &[f64]) -> Vec<bool> {
    if values.windows(2).all(|pair| pair[0] < pair[1]) {
        return vec![true; values.len()];
    }
    // heads[k]: the greatest first value of a selection of length k + 1 from the rows seen.
    let mut heads: Vec<f64> = Vec::new();
    let mut lengths = vec![0; values.len()];
    for (row, &value) in values.iter().enumerate().rev() {
        let longer = heads.partition_point(|&head| head > value);
        lengths[row] = longer + 1;
        match heads.get_mut(longer) {
            None => heads.push(value),
            Some(head) => *head = head.max(value),
        }
    }
    let (mut wanted, mut last) = (heads.len(), f64::NEG_INFINITY);
    let mut marks = vec![false; values.len()];
    for (row, &value) in values.iter().enumerate() {
        if lengths[row] == wanted && value > last {
            marks[row] = true;
            (wanted, last) = (wanted - 1, value);
        }
    }
    marks
}

/// The value below which a share of the values lies, 0 to 1; `None` for nothing.
pub(super) fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    let rank = (share * values.len() as f64) as usize;
    let rank = rank.min(values.len().checked_sub(1)?);
    Some(*values.select_nth_unstable_by(rank, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steady_rows_have_nothing_to_remark() {
        let times: Vec<f64> = (0..100).map(|i| 1000.0 + 0.2 * f64::from(i)).collect();
        let order = TimeOrder::of(&times);
        assert!(order.in_order.iter().all(|&mark| mark));
        assert!((order.counts.step_s - 0.2).abs() < 1e-9);
        let clean =
            OrderCounts { step_s: order.counts.step_s, is_regular: true, ..Default::default() };
        assert_eq!(order.counts, clean);
    }

    #[test]
    fn missing_rows_are_counted_where_they_are() {
        let order = TimeOrder::of(&[0.0, 1.0, 2.0, 6.0, 7.0, 8.0, 10.0, 11.0, 12.0, 13.0, 14.0]);
        assert_eq!((order.counts.gaps, order.counts.longest_gap_s), (2, 4.0));
        assert_eq!(order.counts.missing_rows, 4);
        assert_eq!((order.missing_before[3], order.missing_before[6]), (3, 1));
    }

    #[test]
    fn rows_that_change_places_are_out_of_order_and_leave_no_gap() {
        let order = TimeOrder::of(&[0.0, 1.0, 2.0, 4.0, 3.0, 5.0, 6.0, 7.0, 8.0]);
        assert_eq!((order.counts.out_of_order, order.counts.repeated), (1, 0));
        assert_eq!(order.in_order.iter().filter(|&&mark| mark).count(), 8);
    }

    #[test]
    fn repeated_rows_are_told_from_disorder() {
        let order = TimeOrder::of(&[0.0, 1.0, 1.0, 2.0, 3.0, 0.0, 4.0]);
        assert_eq!((order.counts.out_of_order, order.counts.repeated), (0, 2));
        assert_eq!(order.in_order, [true, true, false, true, true, false, true]);
    }

    #[test]
    fn one_wild_time_does_not_condemn_the_rows_after_it() {
        let order = TimeOrder::of(&[0.0, 1.0, 1e9, 2.0, 3.0, 4.0, -7.0, 5.0]);
        assert_eq!(order.counts.out_of_order, 2);
        assert_eq!(order.counts.gaps, 0);
    }

    #[test]
    fn of_two_rows_that_contradict_each_other_the_first_is_kept() {
        let order = TimeOrder::of(&[0.0, 1.0, 0.5, 2.0]);
        assert_eq!(order.in_order, [true, true, false, true]);
    }

    #[test]
    fn irregular_rows_have_gaps_but_no_count_of_missing_rows() {
        let order = TimeOrder::of(&[0.0, 1.0, 2.5, 6.0, 7.2, 11.0, 100.0, 101.0]);
        assert!(!order.counts.is_regular);
        assert_eq!((order.counts.gaps, order.counts.missing_rows), (1, 0));
    }

    #[test]
    fn few_rows_have_no_step() {
        assert_eq!(TimeOrder::of(&[]).counts.step_s, 0.0);
        assert_eq!(TimeOrder::of(&[3.0]).in_order, [true]);
    }
}
