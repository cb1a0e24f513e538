//! Order of the rows in time: rows out of order, repeated or missing.

use dynocar_core::pipeline::admission::limits::TIME_STEP;
use serde::Serialize;

/// Step ahead in time in s above which the clock was set, and no rows are missing.
const CLOCK_JUMP_S: f64 = TIME_STEP.high;
/// Step in medians above which rows are missing.
const GAP_STEPS: f64 = 1.5;
/// The same for rows without a regular step.
const IRREGULAR_GAP_STEPS: f64 = 5.0;
/// Least share of steps within a quarter of the median in regular rows.
const REGULAR_SHARE: f64 = 0.8;

/// The rows of a run in time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TimeOrder {
    /// True for the rows of the longest selection whose time grows.
    pub in_order: Vec<bool>,
    /// Rows of the recorder that are not in the file before each row: those that are missing by
    /// the time that passed, and those without a time.
    pub lost_before: Vec<u64>,
    /// The counts.
    pub counts: OrderCounts,
}

/// Regularity of a run's rows in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct OrderCounts {
    /// Median time step in s; 0 with fewer than two rows in order.
    pub step_s: f64,
    /// True when most steps are alike, so that missing rows can be detected.
    pub is_regular: bool,
    /// Rows that must be taken out, besides repeated ones, for the time to grow.
    pub out_of_order: usize,
    /// Rows with the time of a row before them.
    pub repeated: usize,
    /// Longer steps than usual that no row out of order fills.
    pub gaps: usize,
    /// Longest gap in s; 0 without one.
    pub longest_gap_s: f64,
    /// Rows missing in the gaps, besides those without a time; counted when the rows are regular.
    pub missing_rows: u64,
}

impl TimeOrder {
    /// Looks at the rows' times in s, all finite; `timeless_before` counts the rows without a
    /// time that stood before each of them in the file.
    pub fn new(times_s: &[f64], timeless_before: Vec<u64>) -> Self {
        let in_order = longest_increasing(times_s);
        let mut counts = OrderCounts::default();
        let displaced_s = counts.count_displaced(times_s, &in_order);
        let steps = pairs(marked(&in_order)).map(|(from, to)| times_s[to] - times_s[from]);
        counts.judge_steps(steps.collect());
        let mut lost_before = timeless_before;
        for (from, to) in pairs(marked(&in_order)) {
            let step_s = times_s[to] - times_s[from];
            if !counts.is_gap(step_s) {
                continue;
            }
            let until = |time: f64| displaced_s.partition_point(|&displaced| displaced < time);
            let displaced = (until(times_s[to]) - until(times_s[from])) as u64;
            let timeless = lost_before[from + 1..=to].iter().sum();
            lost_before[to] += counts.count_gap(step_s, displaced, timeless);
        }
        TimeOrder { in_order, lost_before, counts }
    }

    /// Returns the rows in order.
    pub fn rows(&self) -> impl DoubleEndedIterator<Item = usize> + Clone {
        marked(&self.in_order)
    }
}

fn marked(marks: &[bool]) -> impl DoubleEndedIterator<Item = usize> + Clone {
    (0..marks.len()).filter(|&row| marks[row])
}

/// Returns each row with the one after it.
pub(super) fn pairs(mut rows: impl Iterator<Item = usize>) -> impl Iterator<Item = (usize, usize)> {
    let mut last = rows.next();
    rows.map(move |row| (last.replace(row).unwrap_or(row), row))
}

impl OrderCounts {
    /// Counts the rows that are not in order, and gives the times of those not repeated, sorted.
    fn count_displaced(&mut self, times_s: &[f64], in_order: &[bool]) -> Vec<f64> {
        if !in_order.contains(&false) {
            return Vec::new();
        }
        let ordered_s: Vec<f64> = marked(in_order).map(|row| times_s[row]).collect();
        let others = times_s.iter().zip(in_order).filter(|(_, is_ordered)| !**is_ordered);
        let (repeated, mut displaced_s): (Vec<f64>, Vec<f64>) = others
            .map(|(&time, _)| time)
            .partition(|time| ordered_s.binary_search_by(|other| other.total_cmp(time)).is_ok());
        displaced_s.sort_unstable_by(f64::total_cmp);
        (self.repeated, self.out_of_order) = (repeated.len(), displaced_s.len());
        displaced_s
    }

    fn judge_steps(&mut self, mut steps_s: Vec<f64>) {
        self.step_s = quantile(&mut steps_s, 0.5).unwrap_or(0.0);
        let is_alike = |step: &&f64| (**step - self.step_s).abs() <= 0.25 * self.step_s;
        let alike = steps_s.iter().filter(is_alike).count();
        self.is_regular = alike as f64 >= REGULAR_SHARE * steps_s.len() as f64;
    }

    /// Counts a gap, when rows are missing in it, and gives how many. Rows `displaced` out
    /// of it and rows without a time that stand in it are not missing.
    fn count_gap(&mut self, step_s: f64, displaced: u64, timeless: u64) -> u64 {
        let is_counted = self.is_regular && step_s <= CLOCK_JUMP_S;
        let absent = match is_counted {
            true => ((step_s / self.step_s).round() as u64).saturating_sub(1 + displaced),
            false => 0,
        };
        if is_counted && absent == 0 {
            return 0;
        }
        self.gaps += 1;
        self.longest_gap_s = self.longest_gap_s.max(step_s);
        let missing = absent.saturating_sub(timeless);
        self.missing_rows += missing;
        missing
    }

    /// Returns whether rows are missing within a step of `step_s` seconds.
    pub fn is_gap(&self, step_s: f64) -> bool {
        let steps = if self.is_regular { GAP_STEPS } else { IRREGULAR_GAP_STEPS };
        step_s > steps * self.step_s
    }
}

/// Marks a longest selection of strictly increasing values. Of several it marks the one with the earliest rows, which a
/// reader from the top would keep.
///
/// Patience sorting (Fredman 1975) from the end, n log n; one pass when all increase.
pub(super) fn longest_increasing(values: &[f64]) -> Vec<bool> {
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

/// Returns the value below which a share of the values lies, 0 to 1, which change places; `None` for nothing.
pub(super) fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    let rank = (share * values.len() as f64) as usize;
    let rank = rank.min(values.len().checked_sub(1)?);
    Some(*values.select_nth_unstable_by(rank, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order_of(times_s: &[f64]) -> TimeOrder {
        TimeOrder::new(times_s, vec![0; times_s.len()])
    }

    #[test]
    fn steady_rows_need_no_diagnostic() {
        let times: Vec<f64> = (0..100).map(|i| 1000.0 + 0.2 * f64::from(i)).collect();
        let order = order_of(&times);
        assert!(order.in_order.iter().all(|&mark| mark));
        assert!((order.counts.step_s - 0.2).abs() < 1e-9);
        let clean =
            OrderCounts { step_s: order.counts.step_s, is_regular: true, ..Default::default() };
        assert_eq!(order.counts, clean);
    }

    #[test]
    fn missing_rows_are_counted_where_they_are() {
        let order = order_of(&[0.0, 1.0, 2.0, 6.0, 7.0, 8.0, 10.0, 11.0, 12.0, 13.0, 14.0]);
        assert_eq!((order.counts.gaps, order.counts.longest_gap_s), (2, 4.0));
        assert_eq!(order.counts.missing_rows, 4);
        assert_eq!((order.lost_before[3], order.lost_before[6]), (3, 1));
    }

    #[test]
    fn rows_that_change_places_are_out_of_order_and_leave_no_gap() {
        let order = order_of(&[0.0, 1.0, 2.0, 4.0, 3.0, 5.0, 6.0, 7.0, 8.0]);
        assert_eq!((order.counts.out_of_order, order.counts.repeated), (1, 0));
        assert_eq!((order.counts.gaps, order.counts.missing_rows), (0, 0));
        assert_eq!(order.in_order.iter().filter(|&&mark| mark).count(), 8);
    }

    #[test]
    fn a_row_without_a_time_is_lost_once() {
        let times = [0.0, 1.0, 2.0, 5.0, 6.0, 7.0, 8.0];
        let order = TimeOrder::new(&times, vec![0, 0, 0, 1, 0, 0, 0]);
        assert_eq!((order.counts.gaps, order.counts.missing_rows), (1, 1));
        assert_eq!(order.lost_before[3], 2, "one without a time, one not there");
    }

    #[test]
    fn repeated_rows_are_distinguished_from_disorder() {
        let order = order_of(&[0.0, 1.0, 1.0, 2.0, 3.0, 0.0, 4.0]);
        assert_eq!((order.counts.out_of_order, order.counts.repeated), (0, 2));
        assert_eq!(order.in_order, [true, true, false, true, true, false, true]);
    }

    #[test]
    fn one_wild_time_does_not_condemn_the_rows_after_it() {
        let order = order_of(&[0.0, 1.0, 1e9, 2.0, 3.0, 4.0, -7.0, 5.0]);
        assert_eq!(order.counts.out_of_order, 2);
        assert_eq!(order.counts.gaps, 0);
    }

    #[test]
    fn of_two_rows_that_contradict_each_other_the_first_is_kept() {
        let order = order_of(&[0.0, 1.0, 0.5, 2.0]);
        assert_eq!(order.in_order, [true, true, false, true]);
    }

    #[test]
    fn irregular_rows_have_gaps_but_no_count_of_missing_rows() {
        let order = order_of(&[0.0, 1.0, 2.5, 6.0, 7.2, 11.0, 100.0, 101.0]);
        assert!(!order.counts.is_regular);
        assert_eq!((order.counts.gaps, order.counts.missing_rows), (1, 0));
    }

    #[test]
    fn few_rows_have_no_step() {
        assert_eq!(order_of(&[]).counts.step_s, 0.0);
        assert_eq!(order_of(&[3.0]).in_order, [true]);
    }
}
