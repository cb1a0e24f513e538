//! Elements of a simulated train between its controller and its motion: how forces follow their commands, how
//! disturbances change, and the readings of sensors. Random numbers are arguments.

use std::collections::VecDeque;

/// A dead time: values arrive some steps after they were sent.
#[derive(Clone, Debug)]
pub struct DeadTime<T> {
    waiting: VecDeque<T>,
    steps: usize,
}

impl<T: Copy> DeadTime<T> {
    /// Returns a dead time of `delay_s`, rounded to whole steps. The first value counts as sent all the time before.
    pub fn new(delay_s: f64, step_s: f64) -> Self {
        DeadTime { waiting: VecDeque::new(), steps: (delay_s / step_s).round() as usize }
    }

    /// Returns the same, with `initial` sent all the time before.
    pub fn steady(delay_s: f64, step_s: f64, initial: T) -> Self {
        let mut dead_time = DeadTime::new(delay_s, step_s);
        dead_time.waiting.extend(std::iter::repeat_n(initial, dead_time.steps));
        dead_time
    }

    /// Sends a value, and returns the one that arrives in this step.
    pub fn pass(&mut self, value: T) -> T {
        self.waiting.push_back(value);
        if self.waiting.len() > self.steps + 1 {
            self.waiting.pop_front();
        }
        self.waiting[0]
    }
}

/// Returns a value after one step of a first-order lag towards a constant goal, by the exact solution; without a lag,
/// the goal.
pub fn lagged(value: f64, goal: f64, step_s: f64, lag_s: f64) -> f64 {
    if lag_s <= 0.0 { goal } else { goal + (value - goal) * (-step_s / lag_s).exp() }
}

/// Returns the same by one explicit step of Euler, which never overshoots the goal.
pub fn lagged_explicitly(value: f64, goal: f64, step_s: f64, lag_s: f64) -> f64 {
    value + (step_s / lag_s).min(1.0) * (goal - value)
}

/// Returns the goal, or the value nearest to it that lies within `change` of the present value.
pub fn slewed(value: f64, goal: f64, change: f64) -> f64 {
    goal.clamp(value - change, value + change)
}

/// Returns the next value of a first-order autoregression with the standard deviation `std`: the share `kept` of the
/// value, and noise in proportion to a standard normal `deviate`.
pub fn autoregressed(value: f64, kept: f64, std: f64, deviate: f64) -> f64 {
    kept * value + (1.0 - kept * kept).sqrt() * std * deviate
}

/// Returns the multiple of a quantum next to a value.
pub fn quantised(value: f64, quantum: f64) -> f64 {
    (value / quantum).round() * quantum
}

/// Returns the value that a sensor shows of a quantity that is never negative: exactly 0 where the quantity is 0, else
/// the reading, but at least 0. Where it is 0, no reading is taken.
pub fn shown(truth: f64, reading: impl FnOnce() -> f64) -> f64 {
    if truth > 0.0 { reading().max(0.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_arrive_after_the_dead_time() {
        let mut late = DeadTime::steady(0.2, 0.1, 7);
        assert_eq!([1, 2, 3, 4].map(|value| late.pass(value)), [7, 7, 1, 2]);
        let mut late = DeadTime::new(0.2, 0.1);
        assert_eq!([1, 2, 3, 4].map(|value| late.pass(value)), [1, 1, 1, 2]);
        let mut at_once = DeadTime::new(0.04, 0.1);
        assert_eq!([1, 2].map(|value| at_once.pass(value)), [1, 2]);
    }

    #[test]
    fn lags_and_limits_come_to_their_goal() {
        assert!((lagged(0.0, 1.0, 0.4, 0.4) - (1.0 - (-1.0_f64).exp())).abs() < 1e-12);
        assert_eq!((lagged(0.0, 1.0, 0.4, 0.0), lagged_explicitly(0.0, 1.0, 0.4, 0.0)), (1.0, 1.0));
        assert_eq!(lagged_explicitly(2.0, 4.0, 0.1, 0.4), 2.5);
        assert_eq!((slewed(1.0, 9.0, 2.0), slewed(1.0, 0.5, 2.0)), (3.0, 0.5));
    }

    #[test]
    fn a_sensor_shows_steps_and_nothing_below_zero() {
        assert_eq!(quantised(0.77, 0.25), 0.75);
        assert_eq!([shown(0.0, || 0.3), shown(0.1, || -0.3), shown(0.1, || 0.3)], [0.0, 0.0, 0.3]);
        assert_eq!(autoregressed(2.0, 0.6, 10.0, 1.0), 9.2);
    }
}
