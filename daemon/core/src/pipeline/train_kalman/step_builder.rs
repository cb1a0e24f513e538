//! The step from one sample to the next: forces as they act, and how fast forces and line change.

use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::wind;
use dynocar_model::track::{gradient_error_kept, gradient_error_of_mean};

use super::TrainKalmanSettings;
use super::brake::SlowestBrake;
use super::forces::ForceHistory;
use super::learned_state::{LearnedState, ResistanceBelief};
use super::motion_filter::{FilterStep, MapErrorStep, wind_over};
use crate::pipeline::momentum::UnitSample;

/// How long a change of force is remembered, in s.
const FORCE_RATE_MEMORY_S: f64 = 0.5;
/// Time in s, and distance in m, over which the slope of the known retarding forces is averaged: with noise of the
/// position the gradient jumps to and fro, with many samples often, at a low speed far.
const KNOWN_SLOPE_MEMORY_S: f64 = 1.0;
const KNOWN_SLOPE_MEMORY_M: f64 = 10.0;

/// Random walk of the brake force's scale over an hour of motion.
const BRAKE_DRIFT_PER_SQRT_H: f64 = 0.03;

/// Time in s over which a wind is taken for the same: a step of the filters for each sample would cost time.
const WIND_STEP_S: f64 = 1.0;

/// Memory of the samples from which steps are made.
#[derive(Clone, Debug, PartialEq)]
pub struct StepBuilder {
    settings: TrainKalmanSettings,
    train_length_m: f64,
    /// Error of the map under the train over that at a place, by standard deviation.
    map_share: f64,
    acting: ForceHistory,
    /// Fastest change of the reported force lately in N/kN per s.
    force_rate: f64,
    /// Change of the known retarding forces in N/kN per m.
    known_slope: f64,
    slowest_brake: SlowestBrake,
    /// Time in s since the wind was moved on.
    wind_s: f64,
    /// Time in ns and motion segment of the newest sample.
    seen: Option<(i64, u32)>,
    /// Distance in m since a step was made, infinite before the first.
    unseen_m: f64,
}

impl StepBuilder {
    /// Before the first sample of a train of a length in m.
    pub fn new(settings: &TrainKalmanSettings, train_length_m: f64) -> Self {
        let acting = ForceHistory::default();
        StepBuilder {
            settings: *settings,
            train_length_m,
            map_share: gradient_error_of_mean(train_length_m),
            acting,
            force_rate: 0.0,
            known_slope: 0.0,
            slowest_brake: SlowestBrake::default(),
            wind_s: 0.0,
            seen: None,
            unseen_m: f64::INFINITY,
        }
    }

    /// Takes in the brake-cylinder pressure in Pa, before the forces of the same sample.
    pub fn see_pressure(&mut self, pressure_pa: Option<f64>) {
        self.slowest_brake.see_pressure(pressure_pa);
    }

    /// Takes in the reported forces, also at a standstill, with the slowest brake's times in s to build up and release.
    pub fn see(&mut self, now: &UnitSample, lags_s: &[f64; 2]) {
        self.acting.see((now.time_ns, now.segment), [now.traction, now.brake]);
        let (seen_ns, segment) =
            self.seen.replace((now.time_ns, now.segment)).unwrap_or((i64::MIN, 0));
        let since_s = (now.time_ns.saturating_sub(seen_ns) as f64 * 1e-9).max(0.0);
        // Nobody knows where a train was between two segments.
        let is_followed = segment == now.segment;
        self.unseen_m += if is_followed { since_s * now.speed_mps } else { f64::INFINITY };
        let is_held = now.speed_mps < self.settings.speed_min_mps;
        self.slowest_brake.see(now, since_s, is_held, lags_s);
    }

    /// Begins a motion, and returns the map's error since the one before.
    pub fn begin(&mut self, sample: &ResolvedSample) -> MapErrorStep {
        self.force_rate = 0.0;
        self.map_error(self.unseen_m, sample)
    }

    /// Forgets the line that was driven.
    pub fn leave_line(&mut self) {
        self.unseen_m = f64::INFINITY;
    }

    /// Returns the map's error after a distance in m.
    fn map_error(&mut self, travelled_m: f64, sample: &ResolvedSample) -> MapErrorStep {
        self.unseen_m = 0.0;
        let surveyed = sample.gradient_std_permille;
        let declared = self.map_share * self.settings.gradient_std_permille;
        MapErrorStep {
            std_permille: if surveyed > 0.0 { surveyed } else { declared },
            // The smaller a mean's error, the longer it stays.
            kept: gradient_error_kept(travelled_m * self.map_share.powi(2)),
        }
    }

    /// Returns the step to the newest sample, if forces act by so much in s after their report; the estimator adds the
    /// parts that it alone knows.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn to(
        &mut self,
        (from, to): (&UnitSample, &UnitSample),
        sample: &ResolvedSample,
        (delay_s, learned): (f64, &LearnedState),
        air: &ResistanceBelief,
    ) -> FilterStep {
        let settings = self.settings;
        let duration_s = to.seconds_since(from);
        let faded = self.force_rate * (-duration_s / FORCE_RATE_MEMORY_S).exp();
        let change = to.traction - from.traction;
        self.force_rate = faded.max((change / duration_s).abs());
        let half_s = 0.5 * duration_s;
        let travelled_m = half_s * (from.speed_mps + to.speed_mps);
        if travelled_m > 0.0 {
            let share = (duration_s / KNOWN_SLOPE_MEMORY_S).min(travelled_m / KNOWN_SLOPE_MEMORY_M);
            let slope = (to.known - from.known) / travelled_m;
            self.known_slope += share.min(1.0) * (slope - self.known_slope);
        }
        // A change of gradient or curve passes under the train in many steps, all early or all late.
        let speed_mps = to.speed_mps.max(settings.speed_min_mps);
        let steps = (self.train_length_m / (speed_mps * duration_s)).max(1.0);
        let by_place = steps * (settings.position_std_m * self.known_slope * duration_s).powi(2);
        // Over a time in which the speed's noise averages out gusts follow each other like noise.
        let by_wind = air.by_wind(to.speed_mps);
        let gust_n_per_kn = by_wind * wind::GUST_SHARE * settings.wind_std_mps;
        let by_gusts = 2.0 * wind::GUST_TIME_S * gust_n_per_kn.powi(2) * duration_s;
        let acting = self.acting.over(duration_s, delay_s);
        let known = half_s * (from.known + to.known);
        // By the forces: the speed's noise changes it all the time.
        let changed_mps = (acting.impulses[0] - acting.impulses[1] - known).abs() / to.inertia;
        self.slowest_brake.pass(changed_mps, duration_s);
        let brake = self.slowest_brake.error(to.brake, &learned.brake);
        self.wind_s += duration_s;
        let wind = if self.wind_s < WIND_STEP_S {
            (1.0, 0.0)
        } else {
            wind_over(std::mem::take(&mut self.wind_s), settings.wind_std_mps)
        };
        FilterStep {
            duration_s,
            travelled_m,
            inertia: to.inertia,
            delay_s: acting.delay_s,
            traction: acting.impulses[0],
            brake: acting.impulses[1] + duration_s * brake.late,
            known,
            traction_change: acting.changes[0],
            brake_std: duration_s * brake.std,
            brake_lateness: brake.lateness,
            following: brake.following,
            jump_share: learned.jumps.share,
            impulse_variance: by_place + by_gusts,
            force_rate: self.force_rate,
            direction: sample.direction,
            map_error: self.map_error(travelled_m, sample),
            drift_variance: settings.drift_n_per_kn_per_sqrt_h.powi(2) * duration_s / 3600.0,
            by_wind: sample.direction * by_wind,
            by_wind_square: air.by_wind_square(),
            wind,
            brake_drift_variance: BRAKE_DRIFT_PER_SQRT_H.powi(2) * duration_s / 3600.0,
            brake_error: (brake.kept, 1.0 - brake.kept * brake.kept),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_model::train::Davis;

    const SECOND_NS: i64 = 1_000_000_000;
    const LAGS_S: [f64; 2] = [1.5; 2];

    /// A train that coasts.
    fn coasting(time_ns: i64, speed_mps: f64) -> UnitSample {
        UnitSample {
            time_ns,
            segment: 1,
            speed_mps,
            driving: 0.0,
            traction: 0.0,
            brake: 0.0,
            known: 0.0,
            inertia: 108.0,
        }
    }

    /// Returns the step between two samples of a train with usual settings and Davis 1.5, 0.02 and 0.001.
    fn step(steps: &mut StepBuilder, from: &UnitSample, to: &UnitSample) -> FilterStep {
        let resistance = ResistanceBelief::declared(&Davis { a: 1.5, b: 0.02, c: 0.001 }, 0.4);
        let learned = LearnedState::new(&TrainKalmanSettings::default(), &resistance);
        steps.to((from, to), &ResolvedSample::coasting(), (0.0, &learned), &resistance)
    }

    /// Variance of the impulse over 400 m by where on the line a gradient changes by 6 ‰ under a train of 100 m, which
    /// passes it at a speed.
    fn place_variance(rate_hz: i64, position_noise_m: f64, speed_mps: f64) -> f64 {
        let settings = TrainKalmanSettings { wind_std_mps: 0.0, ..Default::default() };
        let mut steps = StepBuilder::new(&settings, 100.0);
        let sample = |k: i64| {
            let time_s = k as f64 / rate_hz as f64;
            let noise_m = if k % 2 == 0 { position_noise_m } else { -position_noise_m };
            let under_m = (speed_mps * time_s - 100.0 + noise_m).clamp(0.0, 100.0);
            UnitSample { known: 0.06 * under_m, ..coasting(k * SECOND_NS / rate_hz, speed_mps) }
        };
        steps.see(&sample(0), &LAGS_S);
        let of_step = |k: i64| {
            let (from, to) = (sample(k - 1), sample(k));
            steps.see(&to, &LAGS_S);
            step(&mut steps, &from, &to).impulse_variance
        };
        (1..(400.0 / speed_mps) as i64 * rate_hz).map(of_step).sum()
    }

    #[test]
    fn gusts_are_noise_in_proportion_to_air_resistance_and_speed() {
        let settings = TrainKalmanSettings { wind_std_mps: 2.0, ..Default::default() };
        let variance = |c: f64, speed_mps: f64| {
            let resistance = ResistanceBelief::declared(&Davis { a: 1.5, b: 0.02, c }, 0.4);
            let learned = LearnedState::new(&settings, &resistance);
            let mut steps = StepBuilder::new(&settings, 100.0);
            let (from, to) = (coasting(0, speed_mps), coasting(SECOND_NS / 10, speed_mps));
            steps.see(&from, &LAGS_S);
            steps.see(&to, &LAGS_S);
            steps
                .to((&from, &to), &ResolvedSample::coasting(), (0.0, &learned), &resistance)
                .impulse_variance
        };
        // Gusts of 1 m/s for 10 s each: 2 c v, over 0.1 s of independent ones.
        assert!((variance(0.001, 30.0) - 0.06_f64.powi(2) * 2.0 * 10.0 * 0.1).abs() < 1e-9);
        assert!((variance(0.002, 15.0) - variance(0.001, 30.0)).abs() < 1e-9);
    }

    #[test]
    fn the_error_of_the_map_stays_where_the_train_stands_and_is_another_one_elsewhere() {
        let begun = |between: &[UnitSample]| {
            let mut steps = StepBuilder::new(&TrainKalmanSettings::default(), 800.0);
            let sample = ResolvedSample::coasting();
            let first = steps.begin(&sample);
            assert_eq!((first.kept, first.std_permille), (0.0, 0.05), "half of it under 800 m");
            steps.see(&coasting(0, 1.0), &LAGS_S);
            steps.begin(&sample);
            between.iter().for_each(|it| steps.see(it, &LAGS_S));
            steps.begin(&sample).kept
        };
        assert_eq!(begun(&[coasting(60 * SECOND_NS, 0.0)]), 1.0);
        let unseen = begun(&[coasting(20 * SECOND_NS, 20.0)]);
        assert!((unseen - gradient_error_kept(100.0)).abs() < 1e-12, "{unseen}");
        assert_eq!(begun(&[UnitSample { segment: 2, ..coasting(SECOND_NS, 1.0) }]), 0.0);
    }

    #[test]
    fn a_brake_whose_report_fades_before_the_stop_may_act_until_the_train_is_driven() {
        // The standard deviation of the brake force 10 s after the end of its report.
        let std = |speed_mps: f64, traction: f64| {
            let mut steps = StepBuilder::new(&TrainKalmanSettings::default(), 100.0);
            steps.see(&UnitSample { brake: 30.0, ..coasting(0, speed_mps) }, &LAGS_S);
            let after = |k: i64| UnitSample { traction, ..coasting(k * SECOND_NS / 10, speed_mps) };
            (1..=100).for_each(|k| steps.see(&after(k), &LAGS_S));
            let step = step(&mut steps, &after(99), &after(100));
            step.brake_std / step.duration_s
        };
        assert!((std(3.0, 0.0) - 30.0).abs() < 1e-9);
        assert!(std(3.0, 5.0) < 0.1 && std(8.0, 0.0) < 0.1);
    }

    #[test]
    fn a_starting_train_is_held_no_longer_than_there_is_pressure_in_its_cylinders() {
        // The standard deviation of the brake force 1 s after the end of its report, by the pressure after a time in s.
        let std = |pressure_pa: fn(f64) -> Option<f64>| {
            let mut steps = StepBuilder::new(&TrainKalmanSettings::default(), 100.0);
            steps.see_pressure(pressure_pa(0.0));
            steps.see(&UnitSample { brake: 30.0, ..coasting(0, 0.0) }, &LAGS_S);
            let after = |k: i64| UnitSample { traction: 5.0, ..coasting(k * SECOND_NS / 10, 1.0) };
            for k in 1..=10 {
                steps.see_pressure(pressure_pa(0.1 * k as f64));
                steps.see(&after(k), &LAGS_S);
            }
            let step = step(&mut steps, &after(9), &after(10));
            step.brake_std / step.duration_s
        };
        let by_lag = 30.0 * (-1.0_f64 / 1.5).exp();
        let by_pressure = 30.0 * (-1.0_f64 / 0.3).exp();
        assert!((std(|_| None) - by_lag).abs() + (std(|_| Some(2e5)) - by_lag).abs() < 1e-9);
        assert!((std(|time_s| Some(2e5 * (-time_s / 0.3).exp())) - by_pressure).abs() < 1e-9);
        assert_eq!(std(|time_s| Some(if time_s < 0.5 { 2e5 } else { 0.0 })), 0.0);
    }

    #[test]
    fn a_change_of_gradient_is_as_uncertain_at_any_rate_and_speed_and_with_noise_of_the_position() {
        for (rate_hz, noise_m) in [(5, 0.0), (10, 0.0), (50, 0.0), (10, 1.0), (50, 1.0)] {
            for speed_mps in [20.0, 1.0] {
                // 3 m, 6 ‰; the average over a second or 10 m takes off some of it.
                let whole = (3.0 / speed_mps * 6.0_f64).powi(2);
                let share = place_variance(rate_hz, noise_m, speed_mps) / whole;
                assert!((0.7..1.1).contains(&share), "{rate_hz} {noise_m} {speed_mps}: {share}");
            }
        }
    }
}
