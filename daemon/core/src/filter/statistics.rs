//! Statistics of values that come one by one: the median of the newest, and a straight line through points.

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

/// Sums for the least-squares line through (t, x).
///
/// The sums are about t = 0 and x = 0: choose the origin near the points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FittedLine {
    count: f64,
    t: f64,
    tt: f64,
    x: f64,
    tx: f64,
    xx: f64,
}

impl FittedLine {
    /// Takes in a point.
    pub fn push(&mut self, t: f64, x: f64) {
        self.count += 1.0;
        self.t += t;
        self.tt += t * t;
        self.x += x;
        self.tx += t * x;
        self.xx += x * x;
    }

    /// Returns the line through the points of two lines, which must share their origin.
    pub fn joined(&self, other: &FittedLine) -> FittedLine {
        FittedLine {
            count: self.count + other.count,
            t: self.t + other.t,
            tt: self.tt + other.tt,
            x: self.x + other.x,
            tx: self.tx + other.tx,
            xx: self.xx + other.xx,
        }
    }

    /// Returns the number of points.
    pub fn count(&self) -> f64 {
        self.count
    }

    /// Returns the mean of x; 0 without points.
    pub fn mean(&self) -> f64 {
        if self.count > 0.0 { self.x / self.count } else { 0.0 }
    }

    /// Returns the sum of squares of t about its mean: the slope's variance is the points' over this.
    pub fn spread(&self) -> f64 {
        if self.count > 0.0 { (self.tt - self.t * self.t / self.count).max(0.0) } else { 0.0 }
    }

    /// Returns the slope; `None` while all points have the same t.
    pub fn slope(&self) -> Option<f64> {
        let spread = self.spread();
        (spread > 0.0).then(|| (self.tx - self.t * self.mean()) / spread)
    }

    /// Returns the sum of squares of x about the line, with count - 2 degrees of freedom.
    pub fn scatter(&self) -> f64 {
        let about_mean = self.xx - self.count * self.mean() * self.mean();
        let explained = self.slope().map_or(0.0, |slope| slope * slope * self.spread());
        (about_mean - explained).max(0.0)
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

#[cfg(test)]
mod straight_line_tests {
    use super::*;

    #[test]
    fn points_on_a_line_have_its_slope_and_no_scatter() {
        let mut line = FittedLine::default();
        for i in 0..10 {
            line.push(0.2 * f64::from(i), 3.0 - 0.5 * 0.2 * f64::from(i));
        }
        assert!((line.slope().unwrap() + 0.5).abs() < 1e-12);
        assert!(line.scatter() < 1e-12);
        assert!((line.mean() - 2.55).abs() < 1e-12);
    }

    #[test]
    fn joining_equals_pushing_all() {
        let points = [(0.0, 1.0), (1.0, 0.5), (2.0, 1.5), (3.0, 4.0)];
        let (mut all, mut first, mut last) =
            (FittedLine::default(), FittedLine::default(), FittedLine::default());
        for (i, &(t, x)) in points.iter().enumerate() {
            all.push(t, x);
            if i < 2 { first.push(t, x) } else { last.push(t, x) }
        }
        assert_eq!(first.joined(&last), all);
        // By hand: slope 5/5, residuals 0.75, -0.75, -0.75, 0.75.
        assert!((all.slope().unwrap() - 1.0).abs() < 1e-12);
        assert!((all.scatter() - 2.25).abs() < 1e-12);
    }

    #[test]
    fn one_point_has_no_slope() {
        let mut line = FittedLine::default();
        assert_eq!(line.slope(), None);
        line.push(1.0, 2.0);
        assert_eq!(line.slope(), None);
    }
}
