//! Median of the newest values.

/// The median over the newest `L` values, for robust scales (median absolute deviation).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunningMedian<const L: usize> {
    newest: [f64; L],
    sorted: [f64; L],
    next: usize,
    count: usize,
}

impl<const L: usize> Default for RunningMedian<L> {
    fn default() -> Self {
        RunningMedian { newest: [0.0; L], sorted: [0.0; L], next: 0, count: 0 }
    }
}

impl<const L: usize> RunningMedian<L> {
    /// Takes in a value; NaN is ignored.
    ///
    /// # Real-time
    ///
    /// Work in proportion to L, no allocation.
    pub fn push(&mut self, value: f64) {
        if value.is_nan() {
            return;
        }
        if self.count == L {
            let oldest = self.newest[self.next];
            let index = self.sorted[..L].partition_point(|&held| held < oldest);
            self.sorted.copy_within(index + 1..L, index);
            self.count -= 1;
        }
        let index = self.sorted[..self.count].partition_point(|&held| held < value);
        self.sorted.copy_within(index..self.count, index + 1);
        self.sorted[index] = value;
        self.newest[self.next] = value;
        self.next = (self.next + 1) % L;
        self.count += 1;
    }

    /// Returns the number of values held, at most L.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Returns the median of the values held; `None` before the first.
    pub fn median(&self) -> Option<f64> {
        match self.count {
            0 => None,
            count if count % 2 == 1 => Some(self.sorted[count / 2]),
            count => Some(0.5 * (self.sorted[count / 2 - 1] + self.sorted[count / 2])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_equals_the_median_of_the_newest(values in prop::collection::vec(-5.0f64..5.0, 1..60)) {
            let mut running = RunningMedian::<9>::default();
            for (i, &value) in values.iter().enumerate() {
                running.push(value);
                let mut newest = values[(i + 1).saturating_sub(9)..=i].to_vec();
                newest.sort_by(f64::total_cmp);
                let middle = newest.len() / 2;
                let expected = match newest.len() % 2 {
                    1 => newest[middle],
                    _ => 0.5 * (newest[middle - 1] + newest[middle]),
                };
                prop_assert_eq!(running.median(), Some(expected));
            }
        }
    }

    #[test]
    fn nothing_has_no_median_and_nan_is_ignored() {
        let mut running = RunningMedian::<5>::default();
        running.push(f64::NAN);
        assert_eq!(running.median(), None);
        assert_eq!(running.count(), 0);
    }
}
