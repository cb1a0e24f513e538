//! One step of a train's motion, standstill included.

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
