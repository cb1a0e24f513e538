//! Forces as they act, some time after their report, and how late and how strong brakes are, learned from braking to
//! braking.
//!
//! A lagging brake lags at every stop. If its lateness were taken to have mean zero, each of a hundred departures would
//! push the resistance at low speed the same way, by less than its standard deviation, and all of them together by far
//! more.

use super::motion_filter::{BRAKE_ERROR, FilterStep, Following, STATES};
use crate::filter::Gaussian;

/// Number of reports kept: more than a second of them at 50 per second; of faster reports the history is shorter.
const CAPACITY: usize = 64;

/// A report: time in s, forces in N/kN, and their impulses in N/kN s since the first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Report {
    time_s: f64,
    forces: [f64; 2],
    impulses: [f64; 2],
}

/// Traction and brake force of the last moments, joined by straight lines.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceHistory {
    reports: [Report; CAPACITY],
    newest: usize,
    count: usize,
    segment: u32,
    origin_ns: i64,
}

/// Forces over a step: traction, then brake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acting {
    /// Time in s between the report of the force and the force itself.
    pub delay_s: f64,
    /// Impulse in N/kN s.
    pub impulses: [f64; 2],
    /// Change of the force in N/kN from the beginning of the step to its end.
    pub changes: [f64; 2],
}

impl Default for ForceHistory {
    fn default() -> Self {
        ForceHistory {
            reports: [Report::default(); CAPACITY],
            newest: 0,
            count: 0,
            segment: 0,
            origin_ns: 0,
        }
    }
}

impl ForceHistory {
    /// Takes in a report of traction and brake force in N/kN; a new segment erases the reports before it.
    ///
    /// # Real-time
    ///
    /// Constant work, no allocation.
    pub fn see(&mut self, (time_ns, segment): (i64, u32), forces: [f64; 2]) {
        if self.count == 0 || segment != self.segment {
            (self.count, self.newest) = (0, 0);
            (self.segment, self.origin_ns) = (segment, time_ns);
        }
        let time_s = time_ns.saturating_sub(self.origin_ns) as f64 * 1e-9;
        let last = self.reports[self.newest];
        let step_s = time_s - last.time_s;
        let impulses = match self.count {
            0 => [0.0; 2],
            _ => [0, 1].map(|k| last.impulses[k] + 0.5 * step_s * (last.forces[k] + forces[k])),
        };
        self.newest = (self.newest + 1) % CAPACITY;
        self.count = (self.count + 1).min(CAPACITY);
        self.reports[self.newest] = Report { time_s, forces, impulses };
    }

    /// Returns the forces over the step of `step_s` that ends with the newest report, if they act by `delay_s`
    /// behind their report, or by as much as is stored of them.
    ///
    /// # Real-time
    ///
    /// Work in proportion to the reports within the delay, no allocation.
    pub fn over(&self, step_s: f64, delay_s: f64) -> Acting {
        let (newest, oldest) = (self.back(0), self.back(self.count.saturating_sub(1)));
        let most_s = (newest.time_s - oldest.time_s - step_s).max(0.0);
        let delay_s = delay_s.clamp(0.0, most_s);
        let mut back = 0;
        let end = self.at(newest.time_s - delay_s, &mut back);
        let start = self.at(newest.time_s - delay_s - step_s, &mut back);
        Acting {
            delay_s,
            impulses: [0, 1].map(|k| end.impulses[k] - start.impulses[k]),
            changes: [0, 1].map(|k| end.forces[k] - start.forces[k]),
        }
    }

    /// Returns the report `count` before the newest.
    fn back(&self, count: usize) -> &Report {
        &self.reports[(self.newest + CAPACITY - count) % CAPACITY]
    }

    /// Forces and impulses at a time in s, looked for from a report on.
    fn at(&self, time_s: f64, back: &mut usize) -> Report {
        while *back + 2 < self.count && self.back(*back + 1).time_s >= time_s {
            *back += 1;
        }
        let (from, to) = (self.back(*back + 1), self.back(*back));
        let since_s = time_s - from.time_s;
        let step_s = to.time_s - from.time_s;
        let slopes = [0, 1]
            .map(|k| if step_s > 0.0 { (to.forces[k] - from.forces[k]) / step_s } else { 0.0 });
        Report {
            time_s,
            forces: [0, 1].map(|k| from.forces[k] + since_s * slopes[k]),
            impulses: [0, 1]
                .map(|k| from.impulses[k] + since_s * (from.forces[k] + 0.5 * since_s * slopes[k])),
        }
    }
}

/// Weight that a standard deviation beforehand counts for, and the weight of the memory.
const WEIGHT_FIRST: f64 = 2.0;
const WEIGHT_MAX: f64 = 40.0;
/// Greatest square of an error over its variance that counts: a brake that fails is no measure of the others.
const SEEN_MAX: f64 = 30.0;
/// Least standard deviation as a share of the first: brakings differ from each other.
const LEAST_SHARE: f64 = 0.1;

/// Standard deviation of a brake's error, learned from the squares of the estimated error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearnedStd {
    /// The standard deviation.
    pub std: f64,
    least: f64,
    most: f64,
    weight: f64,
}

impl LearnedStd {
    fn new(std: f64, most: f64) -> Self {
        LearnedStd { std, least: LEAST_SHARE * std, most, weight: WEIGHT_FIRST }
    }

    /// Takes in the mean and the variance of an error of variance 1, of which so much is new.
    ///
    /// The square of the mean has the expectation 1 - variance, and is the more informative the smaller the variance.
    /// Returns the weight of this step as a share of the weight of the memory.
    fn learn(&mut self, (mean, variance): (f64, f64), renewed: f64) -> f64 {
        let known = (1.0 - variance).max(0.0);
        if known < 1e-3 {
            return 0.0;
        }
        let weight = renewed * known * known;
        self.weight = (self.weight + weight).min(WEIGHT_MAX);
        let seen = (mean * mean / known).min(SEEN_MAX);
        let square = self.std * self.std * (1.0 + (seen - 1.0) * weight / self.weight);
        self.std = square.sqrt().clamp(self.least, self.most);
        weight / self.weight
    }
}

/// How late a brake is, as a share of the impulse that the slowest brake would lack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lateness {
    /// The mean: the same at every stop, an error that no standard deviation stands for.
    pub mean: f64,
    /// Its difference from braking to braking.
    pub spread: LearnedStd,
}

impl Lateness {
    /// Takes in the brake's error over its standard deviation, in the direction of a late one.
    ///
    /// No brake acts before its report.
    fn learn(&mut self, (mean, variance): (f64, f64), renewed: f64) {
        let std = self.spread.std;
        let share = self.spread.learn((mean, variance), renewed);
        if share > 0.0 {
            let seen = mean / (1.0 - variance);
            let most = SEEN_MAX.sqrt();
            self.mean += share * std * seen.clamp(-most, most);
            self.mean = self.mean.clamp(0.0, self.spread.most);
        }
    }
}

/// Learned behaviour of brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrakeErrors {
    /// By [`Following`].
    late: [Lateness; 4],
    /// Of the reported force.
    pub scale: LearnedStd,
}

impl BrakeErrors {
    /// Before any braking, with the standard deviation of the scale.
    pub fn new(scale_std: f64) -> Self {
        let late = Lateness { mean: 0.0, spread: LearnedStd::new(1.0, 2.0) };
        BrakeErrors { late: [late; 4], scale: LearnedStd::new(scale_std, 1.0) }
    }

    /// Returns how late it is.
    pub fn late(&self, following: Following) -> &Lateness {
        &self.late[following as usize]
    }

    /// Learns from the estimate after a step.
    ///
    /// # Real-time
    ///
    /// Constant work, no allocation.
    pub fn learn(&mut self, step: &FilterStep, belief: &Gaussian<STATES>) {
        let error = (belief.mean[BRAKE_ERROR], belief.covariance[(BRAKE_ERROR, BRAKE_ERROR)]);
        let renewed = step.brake_error.1;
        if step.brake_std > 0.0 {
            // A late brake lacks force while it builds up, and has too much while it is released.
            let sign = if step.following == Following::Building { -1.0 } else { 1.0 };
            let late = (sign * error.0, error.1);
            self.late[step.following as usize].learn(late, renewed * step.brake_lateness);
            self.scale.learn(error, renewed * (1.0 - step.brake_lateness));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.1;

    /// Forces that rise from 1 s on, as reported up to a time in s.
    fn reported(until_s: f64) -> ForceHistory {
        let mut forces = ForceHistory::default();
        for k in 0..=(until_s / STEP_S).round() as i64 {
            let time_s = k as f64 * STEP_S;
            let ramp = (time_s - 1.0).max(0.0);
            forces.see((5_000_000_000 + k * 100_000_000, 1), [6.0 * ramp, 2.0]);
        }
        forces
    }

    #[test]
    fn a_force_acts_later_by_its_delay_also_between_reports() {
        for (until_s, delay_s) in [(3.0, 0.0), (3.0, 0.23), (3.0, 0.7), (1.3, 0.25), (1.1, 0.25)] {
            let acting = reported(until_s).over(STEP_S, delay_s);
            let impulse = |time_s: f64| 3.0 * (time_s - delay_s - 1.0).max(0.0).powi(2);
            let force = |time_s: f64| 6.0 * (time_s - delay_s - 1.0).max(0.0);
            let start_s = until_s - STEP_S;
            assert!((acting.delay_s - delay_s).abs() < 1e-9);
            assert!((acting.impulses[0] - (impulse(until_s) - impulse(start_s))).abs() < 1e-9);
            assert!((acting.changes[0] - (force(until_s) - force(start_s))).abs() < 1e-9);
            assert!(
                (acting.impulses[1] - 2.0 * STEP_S).abs() < 1e-9 && acting.changes[1].abs() < 1e-9
            );
        }
    }

    #[test]
    fn what_is_not_kept_is_not_looked_back_to() {
        let acting = reported(20.0).over(STEP_S, 9.0);
        assert!((acting.delay_s - (CAPACITY as f64 - 2.0) * STEP_S).abs() < 1e-6);
        assert!((reported(0.3).over(STEP_S, 1.0).delay_s - 0.2).abs() < 1e-9);
        let mut forces = reported(20.0);
        forces.see((26_000_000_000, 2), [9.0, 0.0]);
        forces.see((26_100_000_000, 2), [9.0, 0.0]);
        let acting = forces.over(STEP_S, 0.5);
        assert_eq!((acting.delay_s, acting.changes), (0.0, [0.0; 2]));
        assert!((acting.impulses[0] - 0.9).abs() < 1e-9);
    }
}

#[cfg(test)]
mod brake_errors_tests {
    use super::*;

    /// Standard deviation after 200 errors of a size in first standard deviations, each known to a variance of 0.1.
    fn learned(size: f64) -> f64 {
        let mut scale = BrakeErrors::new(0.3).scale;
        for _ in 0..200 {
            scale.learn((size * 0.3 / scale.std * 0.9, 0.1), 1.0);
        }
        scale.std / 0.3
    }

    #[test]
    fn the_standard_deviation_follows_the_errors_within_its_bounds() {
        for size in [0.2, 0.5, 1.0, 2.0] {
            assert!((learned(size) / size - 0.95).abs() < 0.06, "{size}: {}", learned(size));
        }
        assert!((learned(0.0) - LEAST_SHARE).abs() < 1e-9);
        assert!((learned(9.0) - 1.0 / 0.3).abs() < 1e-9, "not above the whole force");
    }

    /// Lateness after 200 brakings of a lateness, each known to a variance of 0.1.
    fn late(lateness: f64) -> Lateness {
        let mut late = *BrakeErrors::new(0.3).late(Following::Starting);
        for _ in 0..200 {
            let error = (lateness - late.mean) / late.spread.std;
            late.learn((0.9 * error, 0.1), 1.0);
        }
        late
    }

    #[test]
    fn what_every_braking_lacks_becomes_the_mean_and_no_spread() {
        for lateness in [0.0, 0.3, 1.0] {
            let late = late(lateness);
            assert!((late.mean - lateness).abs() < 0.02, "{lateness}: {late:?}");
            assert!(late.spread.std < 0.2, "{lateness}: {late:?}");
        }
        assert_eq!(late(-0.5).mean, 0.0, "a brake does not act before its report");
    }

    #[test]
    fn an_error_of_which_nothing_is_known_teaches_nothing() {
        let mut scale = BrakeErrors::new(0.3).scale;
        scale.learn((0.0, 1.0), 1.0);
        assert_eq!(scale, BrakeErrors::new(0.3).scale);
    }
}
