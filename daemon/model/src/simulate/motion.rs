//! A simulated train: one step of its motion, standstill included; how forces follow their commands, how disturbances
//! change, and the readings of sensors. Random numbers are arguments.

use std::collections::VecDeque;

/// Where a train is and how fast it goes along its direction of travel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedMotion {
    /// Distance travelled in m.
    pub distance_m: f64,
    /// Speed in m/s, never negative.
    pub speed_mps: f64,
}

/// No train is faster than this in m/s. A model with a negative resistance, which an optimiser may try, stays finite by
/// it.
pub const SPEED_MAX_MPS: f64 = 250.0;
/// A longer step in s is divided.
pub const STEP_MAX_S: f64 = 1.0;

/// Returns the speed in m/s after `step_s` of an acceleration that changes linearly in time from `start` to
/// `end` (m/s²), never below zero.
///
/// A train that comes to rest within the step stays there until the acceleration turns positive.
#[inline]
pub fn speed_after(speed_mps: f64, start: f64, end: f64, step_s: f64) -> f64 {
    let dips = start < 0.0 && end > 0.0;
    if dips {
        return speed_after_dip(speed_mps, start, end, step_s);
    }
    (speed_mps + 0.5 * step_s * (start + end)).clamp(0.0, SPEED_MAX_MPS)
}

/// The speed is lowest where the acceleration turns positive; from rest it grows only after that.
fn speed_after_dip(speed_mps: f64, start: f64, end: f64, step_s: f64) -> f64 {
    let turn_s = step_s * start / (start - end);
    let lowest_mps = speed_mps + 0.5 * start * turn_s;
    (lowest_mps.max(0.0) + 0.5 * end * (step_s - turn_s)).min(SPEED_MAX_MPS)
}

/// Returns the constant deceleration in m/s² that takes a train from one speed in m/s to another over a distance in m.
pub fn deceleration_mps2((from_mps, to_mps): (f64, f64), over_m: f64) -> f64 {
    (from_mps * from_mps - to_mps * to_mps) / (2.0 * over_m)
}

/// One step of Heun's method for the speed: returns the speed in m/s at its end, and the accelerations in m/s² at both
/// ends. The acceleration depends on the end, 0 or 1, and on the speed there.
#[inline]
pub fn speed_step(
    speed_mps: f64,
    step_s: f64,
    mut acceleration_mps2: impl FnMut(usize, f64) -> f64,
) -> (f64, [f64; 2]) {
    let start = acceleration_mps2(0, speed_mps);
    let predicted_mps = (speed_mps + step_s * start).clamp(0.0, SPEED_MAX_MPS);
    let end = acceleration_mps2(1, predicted_mps);
    (speed_after(speed_mps, start, end, step_s), [start, end])
}

/// One step of Heun's method for a train whose acceleration in m/s² depends on the time in s since
/// the step's start, and on distance and speed.
///
/// A stop within the step ends the way at the stopping point.
#[inline]
pub fn advance(
    motion: SimulatedMotion,
    step_s: f64,
    mut acceleration_mps2: impl FnMut(f64, SimulatedMotion) -> f64,
) -> SimulatedMotion {
    let (speed_mps, [start, end]) = speed_step(motion.speed_mps, step_s, |end, speed_mps| {
        let after_s = end as f64 * step_s;
        let distance_m = motion.distance_m + 0.5 * after_s * (motion.speed_mps + speed_mps);
        acceleration_mps2(after_s, SimulatedMotion { distance_m, speed_mps })
    });
    let travelled_m = if speed_mps > 0.0 || motion.speed_mps == 0.0 {
        // Exact for an acceleration linear in time.
        let bend_m = step_s * step_s * (start - end) / 12.0;
        (0.5 * step_s * (motion.speed_mps + speed_mps) + bend_m).max(0.0)
    } else {
        let braking = -0.5 * (start + end);
        (0.5 * motion.speed_mps * motion.speed_mps / braking).min(motion.speed_mps * step_s)
    };
    SimulatedMotion { distance_m: motion.distance_m + travelled_m, speed_mps }
}

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

    /// Returns the same motion in ten thousand explicit steps.
    fn by_small_steps(speed_mps: f64, start: f64, end: f64, step_s: f64) -> f64 {
        let count = 10_000;
        let h = step_s / f64::from(count);
        (0..count).fold(speed_mps, |v, k| {
            let share = (f64::from(k) + 0.5) / f64::from(count);
            (v + h * (start + share * (end - start))).max(0.0)
        })
    }

    #[test]
    fn a_step_agrees_with_many_small_ones_whatever_the_signs() {
        for speed in [0.0, 0.02, 0.1, 3.0] {
            for start in [-0.8, -0.1, 0.0, 0.3] {
                for end in [-0.8, 0.0, 0.1, 0.9] {
                    let one = speed_after(speed, start, end, 0.5);
                    let many = by_small_steps(speed, start, end, 0.5);
                    assert!((one - many).abs() < 1e-4, "{speed} {start} {end}: {one} {many}");
                }
            }
        }
    }

    #[test]
    fn a_train_pulled_backwards_stays_where_it_is() {
        let at_rest = SimulatedMotion { distance_m: 7.0, speed_mps: 0.0 };
        assert_eq!(advance(at_rest, 1.0, |_, _| -0.4), at_rest);
    }

    #[test]
    fn a_stop_ends_after_the_braking_distance() {
        let mut motion = SimulatedMotion { distance_m: 0.0, speed_mps: 10.03 };
        for _ in 0..100 {
            motion = advance(motion, 0.5, |_, _| -0.8);
        }
        assert_eq!(motion.speed_mps, 0.0);
        assert!((motion.distance_m - 10.03 * 10.03 / 1.6).abs() < 1e-9);
    }
}
#[cfg(test)]
mod element_tests {
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
