//! From one sample to the next: forces as they act, and how fast forces and line change.

use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::wind;

use super::TrainKalmanSettings;
use super::acting_forces::ActingForces;
use super::learned::Resistance;
use super::motion_filter::{Step, wind_over};
use crate::pipeline::momentum::UnitSample;

/// How long a change of force is remembered, in s.
const FORCE_RATE_MEMORY_S: f64 = 0.5;
/// Time in s over which the change of what is known to retard is averaged: positions with noise let the
/// gradient jump to and fro, the more often the more samples there are.
const KNOWN_RATE_MEMORY_S: f64 = 1.0;

/// Time in s over which what a brake exerts beside its report becomes something else.
const BRAKE_ERROR_TIME_S: f64 = 3.0;

/// Memory of the samples from which steps are made.
#[derive(Clone, Debug, PartialEq)]
pub struct Steps {
    settings: TrainKalmanSettings,
    train_length_m: f64,
    acting: ActingForces,
    /// Fastest change of the reported force lately in N/kN per s.
    force_rate: f64,
    /// Change of what is known to retard in N/kN per s.
    known_rate: f64,
    /// Brake force in N/kN of a brake as slow as may be, and the time in ns it refers to.
    followed: f64,
    seen_ns: Option<i64>,
}

impl Steps {
    /// Before the first sample of a train of a length in m.
    pub fn new(settings: &TrainKalmanSettings, train_length_m: f64) -> Self {
        let acting = ActingForces::default();
        Steps {
            settings: *settings,
            train_length_m,
            acting,
            force_rate: 0.0,
            known_rate: 0.0,
            followed: 0.0,
            seen_ns: None,
        }
    }

    /// Takes in what is reported, also at a standstill.
    pub fn see(&mut self, now: &UnitSample) {
        self.acting.see((now.time_ns, now.segment), [now.traction, now.brake]);
        let seen_ns = self.seen_ns.replace(now.time_ns).unwrap_or(i64::MIN);
        let since_s = (now.time_ns.saturating_sub(seen_ns) as f64 * 1e-9).max(0.0);
        let left = (-since_s / self.settings.brake_lag_s).exp();
        self.followed = now.brake + left * (self.followed - now.brake);
    }

    /// Standard deviation in N/kN of a brake force that is reported, if it is that late and that strong.
    fn brake_std(&self, brake: f64) -> f64 {
        let late = (brake - self.followed).abs();
        late.max(self.settings.brake_scale_std * brake)
    }

    /// A motion begins.
    pub fn begin(&mut self) {
        (self.force_rate, self.known_rate) = (0.0, 0.0);
    }

    /// The step to the newest sample, if forces act by so much in s behind their report; what only the
    /// estimator knows is left to it.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn to(
        &mut self,
        (from, to): (&UnitSample, &UnitSample),
        sample: &ResolvedSample,
        (delay_s, jump_share): (f64, f64),
        air: &Resistance,
    ) -> Step {
        let settings = &self.settings;
        let duration_s = to.seconds_since(from);
        let faded = self.force_rate * (-duration_s / FORCE_RATE_MEMORY_S).exp();
        let change = to.traction - from.traction;
        self.force_rate = faded.max((change / duration_s).abs());
        let share = (duration_s / KNOWN_RATE_MEMORY_S).min(1.0);
        self.known_rate += share * ((to.known - from.known) / duration_s - self.known_rate);
        // A change of gradient or curve passes under the train in many steps, all early or all late.
        let speed_mps = to.speed_mps.max(settings.speed_min_mps);
        let steps = (self.train_length_m / (speed_mps * duration_s)).max(1.0);
        let place_s = settings.position_std_m / speed_mps;
        let brake_kept = (-duration_s / BRAKE_ERROR_TIME_S).exp();
        let by_place = steps * (place_s * self.known_rate * duration_s).powi(2);
        // Over a time in which the speed's noise averages out gusts follow each other like noise.
        let by_wind = air.by_wind(to.speed_mps);
        let gust_n_per_kn = by_wind * wind::GUST_SHARE * settings.wind_std_mps;
        let by_gusts = 2.0 * wind::GUST_TIME_S * gust_n_per_kn.powi(2) * duration_s;
        let acting = self.acting.over(duration_s, delay_s);
        let half_s = 0.5 * duration_s;
        Step {
            duration_s,
            travelled_m: half_s * (from.speed_mps + to.speed_mps),
            inertia: to.inertia,
            delay_s: acting.delay_s,
            traction: acting.impulses[0],
            brake: acting.impulses[1],
            known: half_s * (from.known + to.known),
            traction_change: acting.changes[0],
            brake_std: duration_s * self.brake_std(to.brake),
            jump_share,
            impulse_variance: by_place + by_gusts,
            force_rate: self.force_rate,
            map_std_permille: sample.gradient_std_permille,
            drift_variance: settings.drift_n_per_kn_per_sqrt_h.powi(2) * duration_s / 3600.0,
            by_wind: sample.direction * by_wind,
            by_wind_square: air.by_wind_square(),
            wind: wind_over(duration_s, settings.wind_std_mps),
            brake_error: (brake_kept, 1.0 - brake_kept * brake_kept),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_model::train::Davis;

    /// Variance of the impulse over 20 s by where on the line a gradient changes by 6 ‰ under a train of
    /// 100 m, which passes it at 20 m/s.
    fn place_variance(rate_hz: i64, position_noise_m: f64) -> f64 {
        let settings = TrainKalmanSettings { wind_std_mps: 0.0, ..Default::default() };
        let resistance = Resistance::declared(&Davis { a: 1.5, b: 0.02, c: 0.001 }, 0.4);
        let mut steps = Steps::new(&settings, 100.0);
        let sample = |k: i64| {
            let time_s = k as f64 / rate_hz as f64;
            let noise_m = if k % 2 == 0 { position_noise_m } else { -position_noise_m };
            let under_m = (20.0 * (time_s - 5.0) + noise_m).clamp(0.0, 100.0);
            UnitSample {
                time_ns: k * 1_000_000_000 / rate_hz,
                segment: 1,
                speed_mps: 20.0,
                driving: 0.0,
                traction: 0.0,
                brake: 0.0,
                known: 0.06 * under_m,
                inertia: 108.0,
            }
        };
        steps.see(&sample(0));
        let of_step = |k: i64| {
            let (from, to) = (sample(k - 1), sample(k));
            steps.see(&to);
            steps
                .to((&from, &to), &ResolvedSample::coasting(), (0.0, 1.0), &resistance)
                .impulse_variance
        };
        (1..20 * rate_hz).map(of_step).sum()
    }

    #[test]
    fn gusts_are_noise_in_proportion_to_air_resistance_and_speed() {
        let settings = TrainKalmanSettings { wind_std_mps: 2.0, ..Default::default() };
        let variance = |c: f64, speed_mps: f64| {
            let resistance = Resistance::declared(&Davis { a: 1.5, b: 0.02, c }, 0.4);
            let sample = |time_ns: i64| UnitSample {
                time_ns,
                segment: 1,
                speed_mps,
                driving: 0.0,
                traction: 0.0,
                brake: 0.0,
                known: 0.0,
                inertia: 108.0,
            };
            let mut steps = Steps::new(&settings, 100.0);
            let (from, to) = (sample(0), sample(100_000_000));
            steps.see(&from);
            steps.see(&to);
            steps
                .to((&from, &to), &ResolvedSample::coasting(), (0.0, 1.0), &resistance)
                .impulse_variance
        };
        // Gusts of 1 m/s for 10 s each: 2 c v, over 0.1 s of independent ones.
        assert!((variance(0.001, 30.0) - 0.06_f64.powi(2) * 2.0 * 10.0 * 0.1).abs() < 1e-9);
        assert!((variance(0.002, 15.0) - variance(0.001, 30.0)).abs() < 1e-9);
    }

    #[test]
    fn a_change_of_gradient_is_as_uncertain_at_any_rate_and_with_noise_of_the_position() {
        // 3 m at 20 m/s, 6 ‰; the average over a second takes off some of it.
        let whole = (3.0 / 20.0 * 6.0_f64).powi(2);
        for (rate_hz, noise_m) in [(5, 0.0), (10, 0.0), (50, 0.0), (10, 1.0), (50, 1.0)] {
            let share = place_variance(rate_hz, noise_m) / whole;
            assert!((0.7..1.1).contains(&share), "{rate_hz} Hz, {noise_m} m: {share}");
        }
    }
}
