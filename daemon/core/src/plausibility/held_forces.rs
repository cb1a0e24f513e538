//! Forces that are refreshed seldom, or frozen, by the motion.
//!
//! A force that is reported as constant for seconds and then jumps is true while the acceleration stays and jumps with it,
//! as with notches, and stale where the acceleration has gone to the new force before. Over a hold of h s, up to a margin
//! before its end, the acceleration of the second half exceeds that of the first by the jump J times half of the share that
//! was looked at, where the force went straight to its new level, and by nothing where it was true. Least squares over
//! many holds find this factor, apart from that of the jump before the hold, which late actuators follow.

use nalgebra::{Matrix2, Vector2};

/// Shortest and longest hold in s that are looked at: below, a stale force bends nothing.
const HOLD_S: (f64, f64) = (1.8, 30.0);
/// Time in s before the end of a hold that is left out, since reports are late by as much.
const MARGIN_S: f64 = 0.3;
/// Least jump in m/s² that says something.
const JUMP_MIN_MPS2: f64 = 0.03;
/// Time in s since the last brake force: brakes act and release late, and more slowly than any traction.
const UNBRAKED_MIN_S: f64 = 10.0;
/// Time in s between the speeds that are remembered.
const MARK_S: f64 = 0.25;
const MARKS: usize = 1 + (HOLD_S.1 / MARK_S) as usize;
/// Share of the sums that is kept when a hold comes in: holds looked back over.
const KEEP: f64 = 1.0 - 1.0 / 400.0;
/// Time in s of motion without a hold after which the forces are fresh again.
const FRESH_S: f64 = 3600.0;
/// Holds that are enough to judge.
const HOLDS_MIN: f64 = 10.0;
/// Factor from which forces are stale, with its standard deviations above 0, and the greatest of the jump before the
/// hold: simulated traffic with every kind of late brake stays below 0.3 or 3 deviations.
const FACTOR_MIN: f64 = 0.3;
const DEVIATIONS_MIN: f64 = 4.0;
/// Standard deviations above which forces that are called stale stay so.
const DEVIATIONS_STAY: f64 = 2.0;
const BEFORE_MAX: f64 = 0.4;

/// Forces, and the speed, at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForcesNow {
    /// Speed in m/s.
    pub speed_mps: f64,
    /// Traction over mass in m/s².
    pub traction_mps2: f64,
    /// Brake force over mass in m/s².
    pub brake_mps2: f64,
}

/// Follows holds of the forces; of fixed size.
#[derive(Clone, Debug)]
pub struct HeldForces {
    last: Option<ForcesNow>,
    /// Time in s since the forces last changed; `None` until they have.
    held_s: Option<f64>,
    unbraked_s: f64,
    jump_before_mps2: f64,
    marks_mps: [f64; MARKS],
    gram: Matrix2<f64>,
    with_change: Vector2<f64>,
    change_square: f64,
    holds: f64,
    /// Time in s of motion since the last hold that was looked at.
    moved_s: f64,
    is_stale: bool,
}

impl Default for HeldForces {
    fn default() -> Self {
        HeldForces {
            last: None,
            held_s: None,
            unbraked_s: 0.0,
            jump_before_mps2: 0.0,
            marks_mps: [0.0; MARKS],
            gram: Matrix2::zeros(),
            with_change: Vector2::zeros(),
            change_square: 0.0,
            holds: 0.0,
            moved_s: 0.0,
            is_stale: false,
        }
    }
}

impl HeldForces {
    /// Begins anew after a gap, a stop or a sample without forces.
    pub fn interrupt(&mut self) {
        self.last = None;
        self.held_s = None;
        self.unbraked_s = 0.0;
    }

    /// Takes in a sample of a moving train and the time since the one before it; true when a hold ended with it.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn take(&mut self, now: ForcesNow, step_s: f64) -> bool {
        let Some(last) = self.last.replace(now) else { return false };
        self.moved_s += step_s;
        let is_unbraked = last.brake_mps2 == 0.0;
        self.unbraked_s = if is_unbraked { self.unbraked_s + step_s } else { 0.0 };
        let ended_s = self.held_s.map(|held_s| held_s + step_s);
        if (now.traction_mps2, now.brake_mps2) == (last.traction_mps2, last.brake_mps2) {
            if let (Some(from_s), Some(to_s)) = (self.held_s, ended_s) {
                self.mark((from_s, last.speed_mps), (to_s, now.speed_mps));
            }
            self.held_s = ended_s;
            return false;
        }
        let driving = |it: &ForcesNow| it.traction_mps2 - it.brake_mps2;
        let jump_mps2 = driving(&now) - driving(&last);
        let is_looked_at = ended_s.is_some_and(|held_s| self.close(held_s, jump_mps2));
        self.jump_before_mps2 = jump_mps2;
        self.held_s = Some(0.0);
        self.marks_mps[0] = now.speed_mps;
        is_looked_at
    }

    /// Remembers the speeds at the marks between two samples.
    fn mark(&mut self, (from_s, from_mps): (f64, f64), (to_s, to_mps): (f64, f64)) {
        let first = (from_s / MARK_S) as usize + 1;
        for index in (first..MARKS).take_while(|&index| index as f64 * MARK_S <= to_s) {
            let share = (index as f64 * MARK_S - from_s) / (to_s - from_s);
            self.marks_mps[index] = from_mps + share * (to_mps - from_mps);
        }
    }

    /// Returns the remembered speed at a time in s of the hold.
    fn speed_at(&self, time_s: f64) -> f64 {
        let place = time_s / MARK_S;
        let index = (place as usize).min(MARKS - 2);
        let (low, high) = (self.marks_mps[index], self.marks_mps[index + 1]);
        low + (place - index as f64) * (high - low)
    }

    /// Takes in a hold of some s that a jump ended; false for one that says nothing.
    fn close(&mut self, held_s: f64, jump_mps2: f64) -> bool {
        let is_hold = (HOLD_S.0..HOLD_S.1).contains(&held_s);
        let is_free = self.unbraked_s >= UNBRAKED_MIN_S.max(held_s);
        if !is_hold || !is_free || jump_mps2.abs() < JUMP_MIN_MPS2 {
            return false;
        }
        // A mark lies on either side of each of the three times.
        let half_s = 0.5 * (held_s - MARGIN_S);
        let [start, middle, end] = [0.0, half_s, 2.0 * half_s].map(|it| self.speed_at(it));
        let change_mps2 = (end - 2.0 * middle + start) / half_s;
        let expected = half_s / held_s;
        let row = Vector2::new(expected * jump_mps2, expected * self.jump_before_mps2);
        self.moved_s = 0.0;
        self.gram = self.gram * KEEP + row * row.transpose();
        self.with_change = self.with_change * KEEP + row * change_mps2;
        self.change_square = self.change_square * KEEP + change_mps2 * change_mps2;
        self.holds = self.holds * KEEP + 1.0;
        self.is_stale = self.judged();
        true
    }

    /// Returns whether the train goes to its next force before that is reported.
    pub fn are_stale(&self) -> bool {
        self.is_stale && self.moved_s < FRESH_S
    }

    fn judged(&self) -> bool {
        let inverse = (self.gram + Matrix2::identity() * 1e-9).try_inverse();
        let Some(inverse) = inverse.filter(|_| self.holds >= HOLDS_MIN) else { return false };
        let factors = inverse * self.with_change;
        let left = (self.change_square - factors.dot(&self.with_change)).max(0.0);
        let std = (left / (self.holds - 2.0) * inverse[(0, 0)]).sqrt();
        match self.is_stale {
            true => factors[0] > DEVIATIONS_STAY * std,
            false => factors[0] > FACTOR_MIN.max(DEVIATIONS_MIN * std) && factors[1] < BEFORE_MAX,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A traction in m/s² that a driver asks for: ramps, notches, coasting.
    fn asked(time_s: f64) -> f64 {
        0.5 + 0.4 * (time_s / 5.0).sin() + 0.1 * (time_s / 2.3).cos()
    }

    /// Drives for ten minutes with a reported traction that is refreshed now and then; where it is true, the train
    /// follows it, else the one that was asked for.
    fn driven(refresh_s: f64, is_true: bool, lag_s: f64, noise_mps: f64) -> HeldForces {
        let mut watch = HeldForces::default();
        let (step_s, mut speed_mps, mut acts) = (0.1, 20.0, 0.3);
        let mut random = 1_u64;
        for tick in 0..6000 {
            let time_s = step_s * f64::from(tick);
            let reported = asked((time_s / refresh_s + 1e-6).floor() * refresh_s);
            let wanted = if is_true { reported } else { asked(time_s) };
            acts += (wanted - acts) * (1.0 - (-step_s / lag_s).exp());
            speed_mps += step_s * (acts - 0.5);
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let noise = noise_mps * 3.4 * ((random >> 33) as f64 / f64::from(1_u32 << 31) - 0.5);
            let now = ForcesNow {
                speed_mps: speed_mps + noise,
                traction_mps2: reported,
                brake_mps2: 0.0,
            };
            watch.take(now, step_s);
        }
        watch
    }

    #[test]
    fn forces_that_are_refreshed_every_two_seconds_are_stale() {
        for refresh_s in [2.0, 4.0] {
            for lag_s in [0.05, 0.3] {
                assert!(
                    driven(refresh_s, false, lag_s, 0.015).are_stale(),
                    "{refresh_s} s, {lag_s} s"
                );
            }
        }
    }

    #[test]
    fn forces_that_are_fresh_again_for_an_hour_are_stale_no_longer() {
        let mut watch = driven(4.0, false, 0.3, 0.015);
        assert!(watch.are_stale());
        for tick in 0..36_010 {
            let traction_mps2 = 0.3 + 1e-3 * f64::from(tick % 7);
            watch.take(ForcesNow { speed_mps: 20.0, traction_mps2, brake_mps2: 0.0 }, 0.1);
        }
        assert!(!watch.are_stale());
    }

    #[test]
    fn forces_that_hold_as_long_as_they_say_are_not() {
        for refresh_s in [0.1, 1.0, 2.0, 4.0, 15.0] {
            for lag_s in [0.05, 0.3, 1.0, 3.0] {
                let watch = driven(refresh_s, true, lag_s, 0.03);
                assert!(!watch.are_stale(), "{refresh_s} s, lag {lag_s} s: {watch:?}");
            }
        }
        assert!(!driven(1.0, false, 0.1, 0.03).are_stale(), "so seldom it bends nothing");
    }

    #[test]
    fn coasting_and_a_constant_force_are_not_and_a_brake_says_nothing() {
        let mut watch = HeldForces::default();
        for tick in 0..6000 {
            let traction_mps2 = if tick % 300 < 150 { 0.5 } else { 0.0 };
            let brake_mps2 = if tick % 300 < 50 { 0.2 } else { 0.0 };
            let speed_mps = 20.0 + f64::from(tick % 7) * 0.01;
            watch.take(ForcesNow { speed_mps, traction_mps2, brake_mps2 }, 0.1);
        }
        assert!(!watch.are_stale());
    }
}
