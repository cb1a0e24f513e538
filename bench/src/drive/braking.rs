//! The braking curve to a stopping point: a constant deceleration that eases off before the train
//! stands, so that it stops without a jolt.

use super::knowledge::{Ability, Knowledge};

/// Speed in m/s below which the deceleration eases off.
const SOFT_MPS: f64 = 3.0;
/// Share of the deceleration that is left at standstill.
const END_SHARE: f64 = 0.4;
/// Share of the deceleration possible with brake and rail that the plan of an ordinary stop uses.
const PLANNED_SHARE: f64 = 0.85;

/// Deceleration over speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrakingCurve {
    full_mps2: f64,
    /// Distance in m from the point where the deceleration begins to ease off to standstill.
    soft_m: f64,
}

impl BrakingCurve {
    /// Returns the curve of a train that brakes from a speed in m/s: the ordinary one, or a weaker one where
    /// brake or rail are known to carry less.
    pub fn new(knowledge: &Knowledge, ability: &Ability, from_mps: f64) -> Self {
        let possible = PLANNED_SHARE * knowledge.braking_max_mps2(ability, from_mps);
        BrakingCurve::with(ability.braking_mps2.min(possible).max(0.05))
    }

    /// Returns this curve, or a weaker one.
    #[must_use]
    pub fn no_steeper_than(self, other: BrakingCurve) -> Self {
        if other.full_mps2 < self.full_mps2 { other } else { self }
    }

    fn with(full_mps2: f64) -> Self {
        let mut curve = BrakingCurve { full_mps2, soft_m: 0.0 };
        curve.soft_m = curve.distance_m(SOFT_MPS);
        curve
    }

    /// Returns the deceleration in m/s² at a speed in m/s.
    pub fn deceleration_mps2(&self, speed_mps: f64) -> f64 {
        let share = (speed_mps / SOFT_MPS).clamp(0.0, 1.0);
        self.full_mps2 * (END_SHARE + share * (1.0 - END_SHARE))
    }

    /// Returns the distance in m to standstill from a speed in m/s.
    pub fn distance_m(&self, speed_mps: f64) -> f64 {
        if speed_mps > SOFT_MPS {
            let sharp = speed_mps * speed_mps - SOFT_MPS * SOFT_MPS;
            return self.soft_m + sharp / (2.0 * self.full_mps2);
        }
        let (end, growth) = self.soft();
        speed_mps / growth - end / (growth * growth) * (growth * speed_mps / end).ln_1p()
    }

    /// Returns the time in s to standstill from a speed in m/s.
    pub fn time_s(&self, speed_mps: f64) -> f64 {
        let (end, growth) = self.soft();
        let soft_mps = speed_mps.min(SOFT_MPS);
        (growth * soft_mps / end).ln_1p() / growth + (speed_mps - soft_mps) / self.full_mps2
    }

    /// Returns the speed in m/s from which the train stands after a distance in m.
    pub fn speed_mps(&self, left_m: f64) -> f64 {
        let left_m = left_m.max(0.0);
        if left_m >= self.soft_m {
            return (SOFT_MPS * SOFT_MPS + 2.0 * self.full_mps2 * (left_m - self.soft_m)).sqrt();
        }
        let (mut low, mut high) = (0.0, SOFT_MPS);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if self.distance_m(middle) < left_m { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    /// Returns the deceleration in m/s² at standstill, and its increase for each m/s of speed.
    fn soft(&self) -> (f64, f64) {
        (self.full_mps2 * END_SHARE, self.full_mps2 * (1.0 - END_SHARE) / SOFT_MPS)
    }
}

#[cfg(test)]
mod tests {
    use super::super::knowledge::tests::metro;
    use super::*;

    #[test]
    fn distance_and_time_are_the_integrals_of_the_deceleration_and_speed_is_their_inverse() {
        let (knowledge, ability) = metro();
        let curve = BrakingCurve::new(&knowledge, &ability, 20.0);
        for from_mps in [0.5, 2.9, 3.0, 17.0] {
            let (mut speed, mut distance_m, mut time_s) = (from_mps, 0.0, 0.0);
            let step_s = 1e-4;
            while speed > 0.0 {
                distance_m += step_s * speed;
                speed -= step_s * curve.deceleration_mps2(speed);
                time_s += step_s;
            }
            assert!((curve.distance_m(from_mps) - distance_m).abs() < 2e-3, "{from_mps}");
            assert!((curve.time_s(from_mps) - time_s).abs() < 1e-3, "{from_mps}");
            assert!((curve.speed_mps(curve.distance_m(from_mps)) - from_mps).abs() < 1e-6);
        }
    }

    #[test]
    fn a_brake_that_is_known_to_be_weak_is_asked_for_less() {
        let (mut knowledge, ability) = metro();
        let ordinary = BrakingCurve::new(&knowledge, &ability, 20.0);
        knowledge.brake_scale.value = 0.5;
        let weak = BrakingCurve::new(&knowledge, &ability, 20.0);
        assert!(weak.distance_m(20.0) > 1.5 * ordinary.distance_m(20.0));
    }
}
