//! The speed profile that keeps the timetable with the least energy: accelerate in full, cruise, coast, brake. The
//! search finds the cruising speed and the place from which the train coasts. The braking curve to the stopping point
//! has a constant deceleration that eases off before the train stands, so that it stops without a jolt.
//!
//! Distances and gradients between stops are those of the driver's map.

use super::knowledge::{Ability, Knowledge};

/// Length in m of a piece of the map.
pub const PIECE_M: f64 = 10.0;

/// A leg from stop to stop; distances count from its start.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedLeg {
    /// Distance to the stopping point in m.
    pub length_m: f64,
    /// Highest speed in m/s.
    pub top_mps: f64,
    /// When the train should stand at the stopping point, in s since its start.
    pub due_s: f64,
    /// Gradient and curve resistance in ‰ along the direction of travel, by piece of [`PIECE_M`].
    pub slopes_permille: Vec<f64>,
}

impl PlannedLeg {
    /// Returns the gradient and curve resistance in ‰ at a distance in m.
    pub fn slope_permille(&self, at_m: f64) -> f64 {
        let Some(last) = self.slopes_permille.len().checked_sub(1) else { return 0.0 };
        let place = (at_m / PIECE_M).clamp(0.0, last as f64);
        let (index, share) = (place as usize, place.fract());
        let (from, to) = (self.slopes_permille[index], self.slopes_permille[(index + 1).min(last)]);
        from + share * (to - from)
    }

    /// Returns the mean over a section in ‰.
    pub fn mean_slope_permille(&self, from_m: f64, to_m: f64) -> f64 {
        let count = 16;
        let at = |k: i32| from_m + (to_m - from_m) * (f64::from(k) + 0.5) / f64::from(count);
        (0..count).map(|k| self.slope_permille(at(k))).sum::<f64>() / f64::from(count)
    }
}

/// Steps of the leg in a computed run.
const STEPS: usize = 200;
/// Slowest coasting as a share of the cruising speed; below it the train is pulled again.
pub const COASTING_MIN_SHARE: f64 = 0.5;
/// Least cruising speed as a share of the highest speed.
const CRUISE_MIN_SHARE: f64 = 0.4;
/// Looks for the place at which coasting may begin.
const LOOKS: usize = 12;
/// Thirds taken off the range of cruising speeds.
const THIRDS: usize = 8;
/// Share of the time left by which a plan may be early.
const EARLY_SHARE: f64 = 5e-4;

/// Plan that the driver follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrivePlan {
    /// Cruising speed in m/s.
    pub cruise_mps: f64,
    /// Distance in m from which the train coasts.
    pub coast_from_m: f64,
    /// Running time in s from here.
    pub time_s: f64,
    /// Work in J of the traction at the rims from here.
    pub energy_j: f64,
}

/// Everything that a plan follows from.
#[derive(Clone, Copy, Debug)]
pub struct Planner<'a> {
    /// The leg.
    pub leg: &'a PlannedLeg,
    /// The train.
    pub knowledge: &'a Knowledge,
    /// Abilities of the train.
    pub ability: &'a Ability,
}

impl Planner<'_> {
    /// Returns the plan with the least energy, from a distance in m and a speed in m/s, that needs no more than
    /// `left_s`; the fastest one where none does.
    pub fn plan(&self, from: (f64, f64), left_s: f64) -> DrivePlan {
        let top = self.leg.top_mps;
        let fastest = self.run(from, top, self.leg.length_m);
        if fastest.time_s >= left_s {
            return fastest;
        }
        let (mut low, mut high) = (CRUISE_MIN_SHARE * top, top);
        let mut best = self.in_time(from, top, left_s).unwrap_or(fastest);
        for _ in 0..THIRDS {
            let third = (high - low) / 3.0;
            let one = self.in_time(from, low + third, left_s);
            let other = self.in_time(from, high - third, left_s);
            for found in [one, other].into_iter().flatten() {
                if found.energy_j < best.energy_j {
                    best = found;
                }
            }
            // Too slow a cruise is never in time.
            match (one, other) {
                (Some(one), Some(other)) if one.energy_j < other.energy_j => high -= third,
                _ => low += third,
            }
        }
        best
    }

    /// Returns the latest possible coasting that is still in time at a cruising speed in m/s.
    fn in_time(&self, from: (f64, f64), cruise_mps: f64, left_s: f64) -> Option<DrivePlan> {
        let mut best = self.run(from, cruise_mps, self.leg.length_m);
        if best.time_s > left_s {
            return None;
        }
        // Between too early and in time, where a straight line between the two says.
        let at_once = self.run(from, cruise_mps, from.0);
        if at_once.time_s <= left_s {
            return Some(at_once);
        }
        let (mut early, mut early_s) = (at_once, at_once.time_s - left_s);
        let mut late_s = left_s - best.time_s;
        for _ in 0..LOOKS {
            let share = match early_s > 0.2 * left_s {
                true => 0.5,
                false => (early_s / (early_s + late_s)).clamp(0.03, 0.97),
            };
            let place_m = early.coast_from_m + share * (best.coast_from_m - early.coast_from_m);
            let found = self.run(from, cruise_mps, place_m);
            if found.time_s <= left_s {
                (best, late_s) = (found, left_s - found.time_s);
                // The other end counts for less where it stays.
                early_s *= 0.5;
                if late_s <= EARLY_SHARE * left_s {
                    break;
                }
            } else {
                (early, early_s) = (found, found.time_s - left_s);
                late_s *= 0.5;
            }
        }
        Some(best)
    }

    /// Returns the run at a cruising speed with coasting from a distance on.
    pub fn run(
        &self,
        (mut at_m, mut speed_mps): (f64, f64),
        cruise_mps: f64,
        coast_from_m: f64,
    ) -> DrivePlan {
        let curve = BrakingCurve::new(self.knowledge, self.ability, cruise_mps.max(speed_mps));
        let step_m = (self.leg.length_m - at_m).max(1.0) / STEPS as f64;
        let (mut time_s, mut energy_j) = (0.0, 0.0);
        // Beyond all need: a step is a share of the leg.
        for _ in 0..2 * STEPS {
            let mut piece_m = step_m;
            if (at_m + 1e-6..at_m + step_m).contains(&coast_from_m) {
                piece_m = coast_from_m - at_m;
            }
            let spare_m = self.leg.length_m - at_m - curve.distance_m(speed_mps);
            let (force_n, next_mps) =
                self.step((at_m, speed_mps), piece_m, cruise_mps, coast_from_m);
            let next_spare_m = self.leg.length_m - at_m - piece_m - curve.distance_m(next_mps);
            let share = match next_spare_m < 0.0 {
                true => (spare_m / (spare_m - next_spare_m)).clamp(0.0, 1.0),
                false => 1.0,
            };
            let passed_mps = speed_mps + share * (next_mps - speed_mps);
            time_s += 2.0 * share * piece_m / (speed_mps + passed_mps).max(0.01);
            energy_j += share * piece_m * force_n.max(0.0);
            (at_m, speed_mps) = (at_m + share * piece_m, passed_mps);
            if next_spare_m < 0.0 {
                break;
            }
        }
        time_s += curve.time_s(speed_mps);
        DrivePlan { cruise_mps, coast_from_m, time_s, energy_j }
    }

    /// Returns the force in N over a piece of the leg, and the speed in m/s at its end.
    fn step(
        &self,
        (at_m, speed_mps): (f64, f64),
        piece_m: f64,
        cruise_mps: f64,
        coast_from_m: f64,
    ) -> (f64, f64) {
        let slope = self.leg.slope_permille(at_m + 0.5 * piece_m);
        let share = if at_m >= coast_from_m { COASTING_MIN_SHARE } else { 1.0 };
        let target_mps = share * cruise_mps;
        let most_n = self.ability.traction.force_n(speed_mps);
        let is_pulled = speed_mps < target_mps;
        let limit_mps = if is_pulled { target_mps } else { self.leg.top_mps };
        let held_n = match speed_mps > target_mps {
            true => 0.0,
            false => self.knowledge.resisting_n(speed_mps, slope).clamp(0.0, most_n),
        };
        let force_n = if is_pulled { most_n } else { held_n };
        let acceleration = self.knowledge.acceleration_mps2(force_n, speed_mps, slope);
        let free_mps = (speed_mps * speed_mps + 2.0 * piece_m * acceleration).max(1e-4).sqrt();
        let next_mps = free_mps.min(limit_mps.max(speed_mps));
        // The last piece of an acceleration takes as much as it needs.
        let used = match free_mps > next_mps && free_mps > speed_mps {
            true => (next_mps.powi(2) - speed_mps.powi(2)) / (free_mps.powi(2) - speed_mps.powi(2)),
            false => 1.0,
        };
        (used * force_n + (1.0 - used) * held_n, next_mps)
    }
}

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

    fn leg() -> PlannedLeg {
        let slopes = (0..140).map(|piece| if piece < 70 { 4.0 } else { -4.0 }).collect();
        PlannedLeg { length_m: 1400.0, top_mps: 20.0, due_s: 0.0, slopes_permille: slopes }
    }

    fn with<T>(knowledge: &Knowledge, ability: &Ability, look: impl FnOnce(Planner) -> T) -> T {
        look(Planner { leg: &leg(), knowledge, ability })
    }

    #[test]
    fn a_reckoned_run_is_that_of_small_steps_in_time() {
        let (knowledge, ability) = metro();
        let found = with(&knowledge, &ability, |it| it.run((0.0, 0.0), 17.0, 600.0));
        let curve = BrakingCurve::new(&knowledge, &ability, 17.0);
        let (leg, step_s) = (leg(), 1e-3);
        let (mut at_m, mut speed, mut time_s, mut energy_j) = (0.0, 0.0_f64, 0.0, 0.0);
        while curve.distance_m(speed) < leg.length_m - at_m {
            let slope = leg.slope_permille(at_m);
            let force_n = match () {
                () if at_m >= 600.0 => 0.0,
                () if speed < 17.0 => ability.traction.force_n(speed),
                () => knowledge.resisting_n(speed, slope),
            };
            let next = speed + step_s * knowledge.acceleration_mps2(force_n, speed, slope);
            at_m += 0.5 * step_s * (speed + next);
            energy_j += force_n * step_s * speed;
            (speed, time_s) = (next, time_s + step_s);
        }
        time_s += curve.time_s(speed);
        assert!((found.time_s / time_s - 1.0).abs() < 0.005, "{} {time_s}", found.time_s);
        assert!((found.energy_j / energy_j - 1.0).abs() < 0.01, "{} {energy_j}", found.energy_j);
    }

    #[test]
    fn more_time_costs_less_energy_and_no_other_plan_in_time_costs_less() {
        let (knowledge, ability) = metro();
        with(&knowledge, &ability, |planner| {
            let fastest = planner.plan((0.0, 0.0), 0.0);
            let mut before = fastest;
            for late in [1.04, 1.1, 1.2] {
                let left_s = late * fastest.time_s;
                let found = planner.plan((0.0, 0.0), left_s);
                assert!(found.time_s <= left_s && found.time_s > 0.995 * left_s, "{found:?}");
                assert!(found.energy_j < 0.97 * before.energy_j, "{found:?} {before:?}");
                before = found;
                for cruise_mps in (8..=40).map(|half| 0.5 * f64::from(half)) {
                    for coast_from_m in (0..70).map(|piece| 20.0 * f64::from(piece)) {
                        let other = planner.run((0.0, 0.0), cruise_mps, coast_from_m);
                        let is_in_time = other.time_s <= left_s;
                        assert!(
                            !is_in_time || other.energy_j > 0.99 * found.energy_j,
                            "{other:?} {found:?}"
                        );
                    }
                }
            }
        });
    }

    #[test]
    fn a_slope_is_linear_between_pieces_and_constant_beyond() {
        let leg = PlannedLeg {
            length_m: 20.0,
            top_mps: 9.0,
            due_s: 9.0,
            slopes_permille: vec![0.0, 10.0, 4.0],
        };
        assert_eq!([-5.0, 5.0, 10.0, 99.0].map(|at| leg.slope_permille(at)), [0.0, 5.0, 10.0, 4.0]);
        assert!((leg.mean_slope_permille(0.0, 10.0) - 5.0).abs() < 1e-12);
    }

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
