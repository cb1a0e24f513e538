//! Forces that act later than they are reported: a dead time, then a first-order lag.

use super::ResolvedSample;

/// Samples kept: six seconds of the fastest controllers.
const CAPACITY: usize = 2048;
/// A shorter lag in s is none.
const LAG_MIN_S: f64 = 1e-3;

/// Forces (traction, brake) in N.
type Forces = [f64; 2];

/// The forces of the last seconds, and what of them acts now.
#[derive(Clone, Debug)]
pub(super) struct DelayLine {
    delay_s: f64,
    lag_s: f64,
    /// Times in s and forces, a ring.
    past: Vec<(f64, Forces)>,
    next: usize,
    count: usize,
    stretch: u32,
    origin_ns: i64,
    /// Time in s, delayed and lagged forces of the last sample.
    last: Option<(f64, Forces, Forces)>,
}

impl DelayLine {
    pub(super) fn new(delay_s: f64, lag_s: f64) -> Self {
        DelayLine {
            delay_s,
            lag_s,
            past: vec![(0.0, [0.0; 2]); CAPACITY],
            next: 0,
            count: 0,
            stretch: 0,
            origin_ns: 0,
            last: None,
        }
    }

    /// Replaces the reported forces of a sample by those that act; unknown forces stay unknown.
    pub(super) fn pass(&mut self, sample: &mut ResolvedSample) {
        if self.count == 0 || sample.stretch != self.stretch {
            (self.count, self.next, self.last) = (0, 0, None);
            (self.stretch, self.origin_ns) = (sample.stretch, sample.time_ns);
        }
        let (Some(traction), Some(brake)) = (sample.traction_force_n, sample.brake_force_n) else {
            return;
        };
        let time_s = sample.time_ns.saturating_sub(self.origin_ns) as f64 * 1e-9;
        self.past[self.next] = (time_s, [traction, brake]);
        self.next = (self.next + 1) % CAPACITY;
        self.count = (self.count + 1).min(CAPACITY);
        let acting = self.lagged(time_s, self.at(time_s - self.delay_s));
        (sample.traction_force_n, sample.brake_force_n) = (Some(acting[0]), Some(acting[1]));
    }

    /// The reported forces at a time, linear between samples, the oldest before all of them.
    fn at(&self, time_s: f64) -> Forces {
        let entry = |back: usize| self.past[(self.next + CAPACITY - 1 - back) % CAPACITY];
        let mut after = entry(0);
        if after.0 <= time_s {
            return after.1;
        }
        for back in 1..self.count {
            let before = entry(back);
            if before.0 <= time_s {
                let share = (time_s - before.0) / (after.0 - before.0);
                return std::array::from_fn(|k| before.1[k] + share * (after.1[k] - before.1[k]));
            }
            after = before;
        }
        after.1
    }

    /// Response of the lag to an input that is linear between samples.
    fn lagged(&mut self, time_s: f64, input: Forces) -> Forces {
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
