//! The motion of a stop: over time while the brake builds up, over speed from then on.

use super::{EffortPoint, RailAdhesion, Shift, Stop};
use crate::adhesion::Uncertain;

/// Equal steps of speed in a stop.
const STEPS: usize = 128;
/// Equal steps of time before the brake acts, and while it builds up.
const RESPONSE_STEPS: [usize; 2] = [16, 64];

/// State of a stop that is being integrated.
#[derive(Clone, Copy)]
struct Progress {
    time_s: f64,
    distance_m: f64,
    speed_mps: f64,
}

impl Stop<'_> {
    /// Returns the distance and time, or the speed at which there is no deceleration.
    pub(super) fn integrate(&self, shift: Shift) -> Result<(f64, f64), f64> {
        let built_up = self.build_up(shift);
        let step_mps = (built_up.speed_mps - self.to_speed_mps) / (2 * STEPS) as f64;
        let (mut distance_m, mut time_s) = (0.0, 0.0);
        // Simpson's rule.
        for i in 0..=2 * STEPS {
            let speed_mps = self.to_speed_mps + i as f64 * step_mps;
            let deceleration_mps2 = self.deceleration_mps2(speed_mps, shift, f64::INFINITY);
            if deceleration_mps2.is_nan() || deceleration_mps2 <= 0.0 {
                return Err(speed_mps);
            }
            let weight = match i {
                0 => 1.0,
                _ if i == 2 * STEPS => 1.0,
                _ if i % 2 == 1 => 4.0,
                _ => 2.0,
            };
            time_s += weight / deceleration_mps2;
            distance_m += weight * speed_mps / deceleration_mps2;
        }
        let share = step_mps / 3.0;
        Ok((built_up.distance_m + distance_m * share, built_up.time_s + time_s * share))
    }

    /// Returns where the train is once the brake acts in full, or has come to its last speed before.
    fn build_up(&self, shift: Shift) -> Progress {
        let response = &self.response;
        let dead_s = response.dead_time_s + shift.response * response.std_s;
        // The longest of both limits; a brake that grows as the speed falls has its own peak.
        let peak_n = self.brake_effort.iter().map(|it| it.force_n).fold(0.0, f64::max);
        let peak_mps2 = peak_n * lowered(self.brake_scale, shift.brake) / self.inertial_kg();
        let jerk_s = match response.jerk_limit_mps3 {
            0.0 => 0.0,
            jerk_mps3 => peak_mps2 / jerk_mps3,
        };
        let (time_s, speed_mps) = (response.traction_cut_off_s, self.from_speed_mps);
        let mut now = Progress { time_s, distance_m: time_s * speed_mps, speed_mps };
        let phases = [(-dead_s, dead_s), (0.0, response.build_up_s.max(jerk_s))];
        for ((from_s, over_s), steps) in phases.into_iter().zip(RESPONSE_STEPS) {
            let step_s = over_s / steps as f64;
            for k in 0..steps {
                if now.speed_mps <= self.to_speed_mps || over_s <= 0.0 {
                    break;
                }
                let applied_s = from_s + k as f64 * step_s;
                let at = |speed_mps, after_s| self.deceleration_mps2(speed_mps, shift, after_s);
                let middle_mps = now.speed_mps - 0.5 * step_s * at(now.speed_mps, applied_s);
                let middle_mps2 = at(middle_mps, applied_s + 0.5 * step_s);
                now.step(middle_mps2, step_s, self.to_speed_mps);
            }
        }
        now
    }

    fn inertial_kg(&self) -> f64 {
        self.mass_kg * (1.0 + self.rotating_mass_factor)
    }

    /// Returns the deceleration at a speed, a time in s after the brake's dead time.
    fn deceleration_mps2(&self, speed_mps: f64, shift: Shift, applied_s: f64) -> f64 {
        let weight_n = self.mass_kg * self.gravity_mps2;
        let full_n =
            effort_n(self.brake_effort, speed_mps) * lowered(self.brake_scale, shift.brake);
        let carried_n = match self.adhesion {
            RailAdhesion::Unlimited => f64::INFINITY,
            RailAdhesion::Coefficient(given) => weight_n * lowered(given, shift.adhesion),
            RailAdhesion::Law(condition, scale) => {
                weight_n * condition.adhesion(speed_mps) * lowered(scale, shift.adhesion)
            }
        };
        let brake_n = self.built_up_n(full_n, applied_s);
        let [a, b, c] = self.davis;
        let w0 = a + speed_mps * (b + speed_mps * c) - shift.resistance * self.w0_std_n_per_kn;
        let resisting_n = brake_n.min(carried_n) + 1e-3 * weight_n * (w0 + self.gradient_permille);
        resisting_n / self.inertial_kg()
    }

    /// Returns the built-up part of a full brake force a time in s after the dead time.
    fn built_up_n(&self, full_n: f64, applied_s: f64) -> f64 {
        let response = &self.response;
        if applied_s == f64::INFINITY {
            return full_n;
        }
        let share = match response.build_up_s {
            0.0 => f64::from(u8::from(applied_s >= 0.0)),
            build_up_s => (applied_s / build_up_s).clamp(0.0, 1.0),
        };
        let grown_n = match response.jerk_limit_mps3 {
            0.0 => f64::INFINITY,
            jerk_mps3 => self.inertial_kg() * jerk_mps3 * applied_s.max(0.0),
        };
        (share * full_n).min(grown_n)
    }
}

impl Progress {
    /// Goes on for a time in s at a deceleration, at most to the last speed.
    fn step(&mut self, deceleration_mps2: f64, step_s: f64, to_speed_mps: f64) {
        let lost_mps = self.speed_mps - to_speed_mps;
        let over_s = match deceleration_mps2 * step_s > lost_mps {
            true => lost_mps / deceleration_mps2,
            false => step_s,
        };
        let speed_mps = self.speed_mps - over_s * deceleration_mps2;
        self.distance_m += 0.5 * over_s * (self.speed_mps + speed_mps);
        self.time_s += over_s;
        self.speed_mps = speed_mps;
    }
}

fn lowered(given: Uncertain, by: f64) -> f64 {
    (given.value - by * given.std).max(0.0)
}

fn effort_n(points: &[EffortPoint], speed_mps: f64) -> f64 {
    let after = points.partition_point(|point| point.speed_mps <= speed_mps);
    if after == 0 {
        return points[0].force_n;
    }
    let low = points[after - 1];
    let Some(high) = points.get(after) else { return low.force_n };
    let share = (speed_mps - low.speed_mps) / (high.speed_mps - low.speed_mps);
    low.force_n + share * (high.force_n - low.force_n)
}
