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
        sample.tunnel_n_per_kn += in_tunnel * (known.tunnel_c_factor - 1.0) * air
            + (1.0 - in_tunnel) * (windy - air)
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
