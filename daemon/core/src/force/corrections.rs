//! Applies the corrections of a train to its resolved samples.

use super::ResolvedSample;
use super::delay::DelayLine;
use crate::train::{Corrections, TrainModel};

/// Bearings are cold again after a gap of so many s between two samples.
const COLD_AGAIN_S: f64 = 1800.0;
/// 0 °C in K.
const ZERO_DEGC_K: f64 = 273.15;

/// Corrects samples one after the other.
#[derive(Clone, Debug)]
pub(super) struct Corrector {
    corrections: Corrections,
    delay: Option<DelayLine>,
    warm_from_ns: Option<(i64, i64)>,
}

impl Corrector {
    /// `None` when there is nothing to correct.
    pub(super) fn of(train: &TrainModel) -> Option<Self> {
        let corrections = train.corrections;
        let Corrections { actuator_delay_s, actuator_lag_s, .. } = corrections;
        let is_late = actuator_delay_s > 0.0 || actuator_lag_s > 0.0;
        let delay = is_late.then(|| DelayLine::new(actuator_delay_s, actuator_lag_s));
        (corrections != Corrections::NONE).then_some(Corrector {
            corrections,
            delay,
            warm_from_ns: None,
        })
    }

    /// Corrects a sample; what c and w0 scale is taken at the declared ones.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub(super) fn correct(&mut self, train: &TrainModel, sample: &mut ResolvedSample) {
        let known = self.corrections;
        sample.speed_mps /= known.speed_scale;
        sample.traction_force_n = sample.traction_force_n.map(|force| force / known.traction_gain);
        if let Some(delay) = &mut self.delay {
            delay.pass(sample);
        }
        let speed_mps = sample.speed_mps;
        let davis = train.resistance;
        let in_tunnel = sample.tunnel_share.unwrap_or(0.0);
        let air = davis.c * speed_mps * speed_mps;
        let ahead_mps = speed_mps + known.wind_plus_mps * sample.direction;
        let windy = davis.c * ahead_mps * ahead_mps.abs();
        let cold_s = self.since_cold_s(sample.time_ns);
        let warmth_k = sample
            .ambient_temperature_degc
            .map_or(0.0, |degc| degc + ZERO_DEGC_K - known.ambient_reference_k);
        sample.tunnel_n_per_kn += in_tunnel * (known.tunnel_c_factor - 1.0) * air;
        sample.other_n_per_kn += (1.0 - in_tunnel) * (windy - air)
            + known.bearing_delta_a_n_per_kn * (-cold_s / known.bearing_tau_s).exp()
            + known.ambient_w0_per_k * warmth_k * davis.w0_n_per_kn(speed_mps);
    }

    /// Time in s since the bearings were cold.
    fn since_cold_s(&mut self, time_ns: i64) -> f64 {
        let seconds = |from_ns: i64| time_ns.saturating_sub(from_ns) as f64 * 1e-9;
        let from_ns = match self.warm_from_ns {
            Some((from_ns, last_ns)) if seconds(last_ns) < COLD_AGAIN_S => from_ns,
            _ => time_ns,
        };
        self.warm_from_ns = Some((from_ns, time_ns));
        seconds(from_ns).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::parse_train;
    use crate::train::Davis;

    const DAVIS: Davis = Davis { a: 2.0, b: 0.01, c: 0.0004 };

    fn train(corrections: Corrections) -> TrainModel {
        let declared = "[train]\nmass_t = 100\nlength_m = 80\nrotating_mass_factor = 0.06\n\
                        [resistance]\na = 1\nb = 0\nc = 0\n";
        let declared = parse_train("train.toml", declared).expect("a train");
        TrainModel { resistance: DAVIS, corrections, ..declared }
    }

    fn sample() -> ResolvedSample {
        ResolvedSample {
            speed_mps: 25.0,
            traction_force_n: Some(50e3),
            brake_force_n: Some(10e3),
            tunnel_share: Some(0.25),
            ambient_temperature_degc: Some(5.0),
            tunnel_n_per_kn: 0.3,
            other_n_per_kn: 0.2,
            ..ResolvedSample::coasting()
        }
    }

    fn corrected(corrections: Corrections, mut sample: ResolvedSample) -> ResolvedSample {
        let train = train(corrections);
        Corrector::of(&train).expect("something to correct").correct(&train, &mut sample);
        sample
    }

    /// What a correction adds to the resistance in N/kN.
    fn added_n_per_kn(corrections: Corrections, sample: ResolvedSample) -> f64 {
        corrected(corrections, sample).extra_n_per_kn() - sample.extra_n_per_kn()
    }

    #[track_caller]
    fn assert_close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-12, "{found}, expected {expected}");
    }

    #[test]
    fn nothing_known_leaves_nothing_to_do() {
        assert!(Corrector::of(&train(Corrections::NONE)).is_none());
    }

    #[test]
    fn measured_speed_and_reported_traction_are_divided_by_their_scales() {
        let known = Corrections { speed_scale: 1.02, traction_gain: 0.95, ..Corrections::NONE };
        let found = corrected(known, sample());
        assert_close(found.speed_mps, 25.0 / 1.02);
        assert_close(found.traction_force_n.unwrap(), 50e3 / 0.95);
        assert_eq!(found.brake_force_n, Some(10e3));
        assert_eq!(
            corrected(known, ResolvedSample { traction_force_n: None, ..sample() })
                .traction_force_n,
            None
        );
    }

    #[test]
    fn the_factor_of_tunnels_acts_on_the_part_inside() {
        let known = Corrections { tunnel_c_factor: 3.0, ..Corrections::NONE };
        assert_close(added_n_per_kn(known, sample()), 0.25 * 2.0 * 0.0004 * 625.0);
        // Where tunnels are not known, none is assumed.
        let unknown = ResolvedSample { tunnel_share: None, ..sample() };
        assert_close(added_n_per_kn(known, unknown), 0.0);
    }

    #[test]
    fn wind_turns_with_the_direction_and_spares_tunnels() {
        let known = Corrections { wind_plus_mps: 5.0, ..Corrections::NONE };
        let heading = |direction| ResolvedSample { direction, ..sample() };
        assert_close(added_n_per_kn(known, heading(1.0)), 0.75 * 0.0004 * (900.0 - 625.0));
        assert_close(added_n_per_kn(known, heading(-1.0)), 0.75 * 0.0004 * (400.0 - 625.0));
        // A tail wind faster than the train pushes.
        let slow = ResolvedSample { speed_mps: 2.0, ..heading(-1.0) };
        assert_close(added_n_per_kn(known, slow), 0.75 * 0.0004 * (-9.0 - 4.0));
    }

    #[test]
    fn resistance_follows_the_temperature_from_its_reference() {
        let known = Corrections {
            ambient_w0_per_k: -0.01,
            ambient_reference_k: 288.15,
            ..Corrections::NONE
        };
        // 10 K below the reference.
        assert_close(added_n_per_kn(known, sample()), 0.1 * DAVIS.w0_n_per_kn(25.0));
        let unknown = ResolvedSample { ambient_temperature_degc: None, ..sample() };
        assert_close(added_n_per_kn(known, unknown), 0.0);
    }

    #[test]
    fn cold_bearings_warm_up_and_are_cold_again_after_a_long_gap() {
        let known = Corrections {
            bearing_delta_a_n_per_kn: 0.8,
            bearing_tau_s: 400.0,
            ..Corrections::NONE
        };
        let train = train(known);
        let mut corrector = Corrector::of(&train).unwrap();
        let mut added_at = |time_s: f64| {
            let time_ns = 7_000_000_000 + (time_s * 1e9) as i64;
            let mut sample = ResolvedSample { time_ns, ..sample() };
            corrector.correct(&train, &mut sample);
            sample.other_n_per_kn - 0.2
        };
        assert_close(added_at(0.0), 0.8);
        assert_close(added_at(400.0), 0.8 / std::f64::consts::E);
        assert_close(added_at(2000.0), 0.8 * (-5.0_f64).exp());
        assert_close(added_at(2000.0 + COLD_AGAIN_S), 0.8);
        assert_close(added_at(2200.0 + COLD_AGAIN_S), 0.8 * (-0.5_f64).exp());
    }

    #[test]
    fn late_forces_pass_the_delay_with_their_corrected_size() {
        let known = Corrections { actuator_delay_s: 1.0, traction_gain: 2.0, ..Corrections::NONE };
        let train = train(known);
        let mut corrector = Corrector::of(&train).unwrap();
        let mut last = sample();
        for k in 0..=20 {
            let reported_n = f64::from(k) * 100.0;
            last = ResolvedSample {
                time_ns: i64::from(k) * 100_000_000,
                traction_force_n: Some(reported_n),
                ..sample()
            };
            corrector.correct(&train, &mut last);
        }
        assert!((last.traction_force_n.unwrap() - 500.0).abs() < 1e-6, "{last:?}");
    }
}
