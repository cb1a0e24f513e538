//! Forces that act later than they are reported: a dead time, then a first-order lag.

use super::Parameter;
pub use crate::train::numbers::{
    ACTUATOR_DELAY as DELAY, ACTUATOR_LAG as LAG, BRAKE_DELAY, BRAKE_LAG,
};

/// Delay and lag.
pub const PARAMETERS: [Parameter; 2] = [
    Parameter::new("delay_s", (0.0, DELAY.rule.range[1]), 0.05),
    Parameter::new("lag_s", (0.0, 8.0), 0.05),
];
/// Name of the sum of delay and lag, which runs show far better than either of them.
pub const TOGETHER: &str = "delay_and_lag_s";
/// A shorter delay and lag together in s are within a cycle of most controllers.
pub const LEAST_S: f64 = 0.15;
/// Standard deviation in s of the delay between a report and its force.
pub const USUAL_STD_S: f64 = 0.2;
/// Delay in s that the live monitor ascribes to the time stamps.
pub const TOLERATED_S: f64 = 0.3;

/// Samples kept: six seconds of the fastest controllers.
const CAPACITY: usize = 2048;
/// Shortest lag in s.
const LAG_MIN_S: f64 = 1e-3;

/// Traction and brake force in N.
pub type Forces = [f64; 2];

/// Numbers of the last seconds, and the ones in effect now: a dead time, then a first-order lag.
#[derive(Clone, Debug)]
pub struct DelayLine<const N: usize> {
    delay_s: f64,
    lag_s: f64,
    /// Times in s and numbers, a ring.
    past: Vec<(f64, [f64; N])>,
    next: usize,
    count: usize,
    /// How many are newer than the number that was in effect last.
    newer: usize,
    segment: u32,
    origin_ns: i64,
    /// Time in s, delayed and lagged numbers of the last sample.
    last: Option<(f64, [f64; N], [f64; N])>,
}

impl<const N: usize> DelayLine<N> {
    /// Returns a line of a dead time and a lag in s, without numbers.
    pub fn new(delay_s: f64, lag_s: f64) -> Self {
        DelayLine {
            delay_s,
            lag_s,
            past: vec![(0.0, [0.0; N]); CAPACITY],
            next: 0,
            count: 0,
            newer: 0,
            segment: 0,
            origin_ns: 0,
            last: None,
        }
    }

    /// Forgets all numbers, behind another dead time and lag in s.
    pub fn restart(&mut self, delay_s: f64, lag_s: f64) {
        (self.delay_s, self.lag_s) = (delay_s, lag_s);
        (self.count, self.next, self.newer, self.last) = (0, 0, 0, None);
    }

    /// Returns the numbers in effect at a time in ns, which come after those reported then; `None` while none are
    /// reported. A new motion segment erases the numbers before it.
    pub fn acting(
        &mut self,
        (time_ns, segment): (i64, u32),
        reported: Option<[f64; N]>,
    ) -> Option<[f64; N]> {
        self.acting_unless((time_ns, segment), reported, |_| false)
    }

    /// The same, but numbers that come out of the dead time and are `held` move nothing: they take effect as they are,
    /// and the lag starts from 0 after them.
    pub fn acting_unless(
        &mut self,
        (time_ns, segment): (i64, u32),
        reported: Option<[f64; N]>,
        held: impl FnOnce(&[f64; N]) -> bool,
    ) -> Option<[f64; N]> {
        if self.count == 0 || segment != self.segment {
            (self.count, self.next, self.newer, self.last) = (0, 0, 0, None);
            (self.segment, self.origin_ns) = (segment, time_ns);
        }
        let reported = reported?;
        let time_s = time_ns.saturating_sub(self.origin_ns) as f64 * 1e-9;
        self.past[self.next] = (time_s, reported);
        self.next = (self.next + 1) % CAPACITY;
        self.count = (self.count + 1).min(CAPACITY);
        let input = self.at(time_s - self.delay_s);
        if held(&input) {
            self.last = Some((time_s, [0.0; N], [0.0; N]));
            return Some(input);
        }
        Some(self.lagged(time_s, input))
    }

    /// Returns the reported numbers at a time, linear between samples, the oldest before all of them.
    fn at(&mut self, time_s: f64) -> [f64; N] {
        let entry = |back: usize| self.past[(self.next + CAPACITY - 1 - back) % CAPACITY];
        // Times grow: the number in effect last has become one older, and the one in effect now is no older.
        let mut back = (self.newer + 1).min(self.count - 1);
        while back > 0 && entry(back - 1).0 <= time_s {
            back -= 1;
        }
        self.newer = back;
        let before = entry(back);
        if back == 0 || before.0 > time_s {
            return before.1;
        }
        let after = entry(back - 1);
        let share = (time_s - before.0) / (after.0 - before.0);
        std::array::from_fn(|k| before.1[k] + share * (after.1[k] - before.1[k]))
    }

    /// Response of the lag to an input that is linear between samples.
    fn lagged(&mut self, time_s: f64, input: [f64; N]) -> [f64; N] {
        let output = match self.last {
            Some((last_s, last_input, last_output)) if self.lag_s > LAG_MIN_S => {
                let step_s = time_s - last_s;
                if step_s <= 0.0 {
                    last_output
                } else {
                    let fade = (-step_s / self.lag_s).exp();
                    std::array::from_fn(|k| {
                        let slope = (input[k] - last_input[k]) / step_s;
                        fade * last_output[k]
                            + (1.0 - fade) * last_input[k]
                            + slope * (step_s - self.lag_s * (1.0 - fade))
                    })
                }
            }
            _ => input,
        };
        self.last = Some((time_s, input, output));
        output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.1;

    fn at(time_s: f64, segment: u32) -> (i64, u32) {
        (5_000_000_000 + (time_s * 1e9).round() as i64, segment)
    }

    /// Forces that act at the times of a recording with reported traction and brake forces.
    fn acting(
        line: &mut DelayLine<2>,
        reported: impl Fn(f64) -> Forces,
        count: usize,
    ) -> Vec<(f64, Forces)> {
        (0..count)
            .map(|k| {
                let time_s = k as f64 * STEP_S;
                (time_s, line.acting(at(time_s, 1), Some(reported(time_s))).unwrap())
            })
            .collect()
    }

    #[test]
    fn a_dead_time_moves_both_forces_later_also_between_samples() {
        let reported = |time_s: f64| [1000.0 * time_s, 50.0 - 3.0 * time_s];
        // 0.73 s is no multiple of the step.
        for (time_s, forces) in acting(&mut DelayLine::new(0.73, 0.0), reported, 100) {
            let expected = reported((time_s - 0.73).max(0.0));
            for (found, expected) in forces.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-6, "{time_s} s: {found} {expected}");
            }
        }
    }

    #[test]
    fn a_lag_builds_a_step_up_exponentially() {
        let step = |time_s: f64| [if time_s > 0.95 { 8000.0 } else { 0.0 }, 0.0];
        let lag_s = 0.8;
        for (time_s, [found, _]) in acting(&mut DelayLine::new(0.0, lag_s), step, 60) {
            // Linear between samples: the force rises from 0.9 s to 1.0 s.
            let ramp = |since_s: f64| since_s - lag_s * (1.0 - (-since_s / lag_s).exp());
            let [from_s, to_s] = [time_s - 0.9, time_s - 1.0].map(|since_s| since_s.max(0.0));
            let expected = 8000.0 / STEP_S * (ramp(from_s) - ramp(to_s));
            assert!((found - expected).abs() < 1e-6, "{time_s} s: {found} {expected}");
        }
    }

    #[test]
    fn dead_time_and_lag_follow_one_another() {
        let step = |time_s: f64| [if time_s > 0.95 { 8000.0 } else { 0.0 }, 0.0];
        let lagged = acting(&mut DelayLine::new(0.0, 0.8), step, 60);
        let both = acting(&mut DelayLine::new(0.5, 0.8), step, 60);
        for k in 5..60 {
            assert!((both[k].1[0] - lagged[k - 5].1[0]).abs() < 1e-6, "{k}");
        }
    }

    #[test]
    fn a_new_segment_forgets_the_forces_before_it() {
        let mut line = DelayLine::new(1.0, 0.5);
        acting(&mut line, |_| [9000.0, 0.0], 50);
        assert_eq!(line.acting(at(60.0, 2), Some([100.0, 20.0])), Some([100.0, 20.0]));
    }

    #[test]
    fn unknown_forces_stay_unknown_and_the_known_ones_bridge_them() {
        let mut line = DelayLine::new(0.2, 0.0);
        for k in 0..10 {
            let known = (k != 4).then_some([7.0, 1.0]);
            assert_eq!(line.acting(at(f64::from(k) * STEP_S, 1), known), known, "{k}");
        }
    }
}
