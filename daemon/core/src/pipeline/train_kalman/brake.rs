//! How late and how strong brakes are, learned from braking to braking.
//!
//! A lagging brake lags at every stop. If its lateness were taken to have mean zero, each of a hundred departures would
//! push the resistance at low speed the same way, by less than its standard deviation, and all of them together by far
//! more.

use super::motion_filter::{BRAKE_ERROR, FilterStep, Following, STATES};
use crate::filter::Gaussian;
use crate::pipeline::momentum::UnitSample;

/// Change of speed in m/s, and time in s, over which the difference between brake force and report becomes another one:
/// friction depends on speed, is blended by speed, and heats up in a long descent.
const BRAKE_ERROR_MPS: f64 = 3.0;
const BRAKE_ERROR_TIME_S: f64 = 600.0;

/// Standard deviation in N/kN of a brake force below which it is taken for exact.
const BRAKE_STD_LEAST: f64 = 1e-3;
/// Force in N/kN below which a brake is taken to have been released.
const RELEASED: f64 = 0.1;
/// Share of a released force that is little, and how often the error is renewed from there on.
const FADED: (f64, f64) = (0.25, 3.0);
/// Speed in m/s below which friction may take over from an electric brake.
const FRICTION_MPS: f64 = 4.0;

/// Error of a brake force over a step.
pub struct BrakeError {
    /// Way in which it follows its report.
    pub following: Following,
    /// Expected force beyond its report in N/kN.
    pub late: f64,
    /// Standard deviation in N/kN.
    pub std: f64,
    /// Share of its square by how late the brake is.
    pub lateness: f64,
    /// Share of the error that is left of the step before.
    pub kept: f64,
}

/// Brake as slow as may be.
#[derive(Clone, Debug, PartialEq)]
pub struct SlowestBrake {
    /// Its force in N/kN.
    force: f64,
    /// Greatest force in N/kN beyond the report since it is released.
    released: f64,
    /// True while little of that is left.
    is_faded: bool,
    /// True from a report of the brake until one of traction.
    is_braking: bool,
    /// True while a brake may act that is not reported.
    is_stopping: bool,
    /// True from a standstill until the brake that held the train is released.
    was_held: bool,
    /// Brake-cylinder pressure in Pa of the newest sample, and the share that it is of the pressure before, 1 at most.
    pressure_pa: Option<f64>,
    pressure_left: f64,
    /// Direction between an error of the brake's scale and one of its time, of the newest step: one says nothing of the
    /// other.
    angle: f64,
    /// How often the brake's error was renewed since it was used last.
    renewals: f64,
}

impl Default for SlowestBrake {
    fn default() -> Self {
        SlowestBrake {
            force: 0.0,
            released: 0.0,
            is_faded: false,
            is_braking: false,
            is_stopping: false,
            was_held: false,
            pressure_pa: None,
            pressure_left: 1.0,
            angle: 0.0,
            renewals: 0.0,
        }
    }
}

impl SlowestBrake {
    /// Takes in the brake-cylinder pressure in Pa, before the forces of the same sample.
    pub fn see_pressure(&mut self, pressure_pa: Option<f64>) {
        let before_pa = std::mem::replace(&mut self.pressure_pa, pressure_pa);
        self.pressure_left = match before_pa.zip(pressure_pa) {
            Some((before_pa, now_pa)) if before_pa > 0.0 => (now_pa / before_pa).clamp(0.0, 1.0),
            _ => 1.0,
        };
    }

    /// Takes in the reported forces some time in s after the ones before, of a train that may be held; the brake builds
    /// up and is released with time constants in s.
    pub fn see(&mut self, now: &UnitSample, since_s: f64, is_held: bool, lags_s: &[f64; 2]) {
        self.was_held |= is_held;
        let lagging = (-since_s / lags_s[usize::from(now.brake < self.force)]).exp();
        // A standing train is held by friction, whose force is in proportion to the pressure.
        let left = if self.was_held { lagging.min(self.pressure_left) } else { lagging };
        self.is_braking |= now.brake > RELEASED;
        self.is_braking &= now.traction <= RELEASED;
        self.is_stopping = self.is_braking && now.speed_mps < FRICTION_MPS && !is_held;
        let force = now.brake + left * (self.force - now.brake);
        self.force = if self.is_stopping { force.max(self.force) } else { force };
    }

    /// Lets forces change the speed by so much in m/s, in a time in s.
    pub fn pass(&mut self, changed_mps: f64, duration_s: f64) {
        self.renewals += changed_mps / BRAKE_ERROR_MPS + duration_s / BRAKE_ERROR_TIME_S;
    }

    /// Returns how far a reported brake force in N/kN may be off; its error goes on while no brake acts.
    pub fn error(&mut self, reported: f64, learned: &BrakeErrors) -> BrakeError {
        let lacking = reported - self.force;
        self.was_held &= lacking < -RELEASED;
        self.released = if lacking >= 0.0 { 0.0 } else { self.released.max(-lacking) };
        let is_faded = -lacking < FADED.0 * self.released;
        if std::mem::replace(&mut self.is_faded, is_faded) != is_faded {
            self.renewals += FADED.1;
        }
        let following = match lacking >= 0.0 {
            true => Following::Building,
            false if is_faded && !self.is_stopping => Following::Fading,
            false if self.was_held => Following::Starting,
            false if self.is_stopping => Following::Stopping,
            false => Following::Releasing,
        };
        let lateness = learned.late(following);
        let expected = -lateness.mean * lacking;
        let (late, scale) = (lateness.spread.std * lacking, learned.scale.std * reported);
        let square = late * late + scale * scale;
        if square < BRAKE_STD_LEAST * BRAKE_STD_LEAST {
            return BrakeError { following, late: expected, std: 0.0, lateness: 0.0, kept: 1.0 };
        }
        let before = std::mem::replace(&mut self.angle, late.atan2(scale));
        let renewals = std::mem::take(&mut self.renewals) + (self.angle - before).abs();
        BrakeError {
            following,
            late: expected,
            std: square.sqrt(),
            lateness: late * late / square,
            kept: (-renewals).exp(),
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
    const fn new(std: f64, most: f64) -> Self {
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

/// Lateness beyond which a brake is slower than the slowest one so far, and the weight of brakings that have to show it.
const SLOWER: (f64, f64) = (1.3, 2.4);
/// Factor by which the slowest brake becomes slower, and the longest time in s that it takes.
const SLOWER_STEP: f64 = 2.0;
const LAG_MOST_S: f64 = 16.0;

/// How late a brake is, as a share of the impulse that the slowest brake would lack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lateness {
    /// The mean: the same at every stop, an error that no standard deviation stands for.
    pub mean: f64,
    /// Its difference from braking to braking.
    pub spread: LearnedStd,
}

impl Lateness {
    /// Before any braking.
    const UNKNOWN: Self = Lateness { mean: 0.0, spread: LearnedStd::new(1.0, 2.0) };

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
    late: [Lateness; 5],
    /// Of the reported force.
    pub scale: LearnedStd,
    /// Times in s within which the slowest brake builds up, and is released, as time constants.
    pub lags_s: [f64; 2],
}

impl BrakeErrors {
    /// Before any braking, with the standard deviation of the scale and the time constant in s of the slowest brake.
    pub fn new(scale_std: f64, lag_s: f64) -> Self {
        let scale = LearnedStd::new(scale_std, 1.0);
        BrakeErrors { late: [Lateness::UNKNOWN; 5], scale, lags_s: [lag_s; 2] }
    }

    /// Returns how late it is.
    pub fn late(&self, following: Following) -> &Lateness {
        &self.late[following as usize]
    }

    /// Learns from the estimate after a step. Returns true when the brake is slower than the slowest one so far: the
    /// force that was left was then taken for the train's.
    ///
    /// # Real-time
    ///
    /// Constant work, no allocation.
    pub fn learn(&mut self, step: &FilterStep, belief: &Gaussian<STATES>) -> bool {
        let error = (belief.mean[BRAKE_ERROR], belief.covariance[(BRAKE_ERROR, BRAKE_ERROR)]);
        let renewed = step.brake_error.1;
        if step.brake_std > 0.0 {
            // A late brake lacks force while it builds up, and has too much while it is released.
            let sign = if step.following == Following::Building { -1.0 } else { 1.0 };
            let late = (sign * error.0, error.1);
            self.late[step.following as usize].learn(late, renewed * step.brake_lateness);
            self.scale.learn(error, renewed * (1.0 - step.brake_lateness));
            return self.slow_down(step.following);
        }
        false
    }

    /// Makes the slowest brake slower, where brakings have shown one.
    fn slow_down(&mut self, following: Following) -> bool {
        let late = &self.late[following as usize];
        if late.mean <= SLOWER.0 || late.spread.weight < SLOWER.1 {
            return false;
        }
        let with_it: &[Following] = match following {
            // A brake whose report fades before the stop is not slow.
            Following::Stopping => return false,
            Following::Building => &[Following::Building],
            _ => &[Following::Starting, Following::Releasing, Following::Fading],
        };
        let lag_s = &mut self.lags_s[usize::from(following != Following::Building)];
        if *lag_s * SLOWER_STEP > LAG_MOST_S {
            return false;
        }
        *lag_s *= SLOWER_STEP;
        with_it.iter().for_each(|&it| self.late[it as usize] = Lateness::UNKNOWN);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Standard deviation after 200 errors of a size in first standard deviations, each known to a variance of 0.1.
    fn learned(size: f64) -> f64 {
        let mut scale = BrakeErrors::new(0.3, 1.5).scale;
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
        let mut late = *BrakeErrors::new(0.3, 1.5).late(Following::Starting);
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
    fn a_brake_slower_than_the_slowest_one_makes_that_slower() {
        let lags_s = |following: Following, lateness: f64| {
            let mut brake = BrakeErrors::new(0.3, 1.5);
            for _ in 0..20 {
                brake.late[following as usize].learn((0.9 * lateness, 0.1), 1.0);
                brake.slow_down(following);
            }
            brake.lags_s
        };
        assert_eq!(lags_s(Following::Building, 3.0), [12.0, 1.5]);
        assert_eq!(lags_s(Following::Starting, 3.0), [1.5, 12.0]);
        assert_eq!(lags_s(Following::Releasing, 3.0), [1.5, 12.0]);
        assert_eq!(lags_s(Following::Stopping, 3.0), [1.5; 2]);
        assert_eq!(lags_s(Following::Releasing, 0.05), [1.5; 2]);
    }

    #[test]
    fn an_error_of_which_nothing_is_known_teaches_nothing() {
        let mut scale = BrakeErrors::new(0.3, 1.5).scale;
        scale.learn((0.0, 1.0), 1.0);
        assert_eq!(scale, BrakeErrors::new(0.3, 1.5).scale);
    }
}
