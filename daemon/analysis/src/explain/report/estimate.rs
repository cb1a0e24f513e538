//! A value and its uncertainty.

use dynocar_shared::HALF_95;

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntervalEstimate {
    /// The value.
    pub value: f64,
    /// The interval; `None` where there is no standard deviation.
    pub interval: Option<[f64; 2]>,
}

impl IntervalEstimate {
    /// Returns a value with 1.96 standard deviations to either side; without an interval when these are no number.
    pub fn normal(value: f64, deviation: f64) -> Self {
        let half = HALF_95 * deviation;
        let is_known = half.is_finite() && half > 0.0;
        IntervalEstimate { value, interval: is_known.then_some([value - half, value + half]) }
    }

    /// Returns the same for a value that cannot be less than `least`.
    pub fn at_least(self, least: f64) -> Self {
        let interval = self.interval.map(|ends| ends.map(|it| it.max(least)));
        IntervalEstimate { interval, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_interval_reaches_below_what_a_number_can_be() {
        let lag_s = IntervalEstimate::normal(0.1, 1.0);
        let [low, high] = lag_s.at_least(0.0).interval.expect("an interval");
        assert_eq!((low, high), (0.0, 0.1 + HALF_95));
        assert_eq!(lag_s.at_least(f64::NEG_INFINITY).interval, lag_s.interval);
    }
}
