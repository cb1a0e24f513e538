//! Cold bearings that warm up: a is larger by delta exp(-t / tau), with t counted from the time at which they were
//! cold.
//!
//! They are cold at the first sample, after a gap of half an hour, and where a clock that was set
//! back leaves unknown how long the train stood. A new trip soon after the last finds them warm.

use dynocar_shared::vocabulary::EffectKind;

use super::{Parameter, Resistance, Suspect};
pub use crate::train::numbers::{BEARING_DELTA_A as DELTA_A, BEARING_TAU as TAU};

/// Delta and tau.
pub const PARAMETERS: [Parameter; 2] = [
    Parameter::new("delta_a_n_per_kn", (0.0, 20.0), 0.02),
    Parameter::new("tau_s", (40.0, 3000.0), 5.0),
];
/// Time constant in s that is assumed before one is known.
pub const TYPICAL_TAU_S: f64 = 200.0;
/// Standard deviation of the resistance that bearings usually add at the start, before they are warm, as a share of a.
pub const USUAL_STD: f64 = 0.05;
/// Bearings are cold again after a gap of this many s between two samples.
pub const COLD_AGAIN_S: f64 = 1800.0;

/// Since when the bearings have been warming up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WarmUp {
    /// When they were cold, and the newest sample, in ns.
    from_and_last_ns: Option<(i64, i64)>,
}

impl WarmUp {
    /// Returns the time in s since the bearings were cold, at a sample.
    pub fn since_cold_s(&mut self, time_ns: i64) -> f64 {
        let seconds = |from_ns: i64| time_ns.saturating_sub(from_ns) as f64 * 1e-9;
        let from_ns = match self.from_and_last_ns {
            Some((from_ns, last_ns)) if (0.0..COLD_AGAIN_S).contains(&seconds(last_ns)) => from_ns,
            _ => time_ns,
        };
        self.from_and_last_ns = Some((from_ns, time_ns));
        seconds(from_ns)
    }
}

/// Adds the resistance of bearings that were cold `since_cold_s` seconds ago.
#[inline]
pub fn act(delta_a_n_per_kn: f64, tau_s: f64, since_cold_s: f64, resistance: &mut Resistance) {
    resistance.bearing_n_per_kn += delta_a_n_per_kn * (-since_cold_s / tau_s).exp();
}

/// Unit: the declared a, added at a cold start.
pub const SUSPECT: Suspect = Suspect {
    is_positive: true,
    ..Suspect::new(EffectKind::BearingTemperature, 1.0, |seen| {
        let mut cold = Resistance::BASIC;
        act(seen.davis.a, TYPICAL_TAU_S, seen.since_cold_s, &mut cold);
        cold.bearing_n_per_kn
    })
};

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    #[test]
    fn bearings_are_cold_first_after_a_long_gap_and_after_a_clock_set_back_and_warm_after_a_trip() {
        let mut warm_up = WarmUp::default();
        let mut assert_s = |at_s: i64, expected_s: f64| {
            let found_s = warm_up.since_cold_s(at_s * S);
            assert!((found_s - expected_s).abs() < 1e-9, "{at_s} s: {found_s} of {expected_s}");
        };
        assert_s(7, 0.0);
        assert_s(407, 400.0);
        // The next trip.
        assert_s(2000, 1993.0);
        assert_s(3800, 0.0);
        assert_s(3900, 100.0);
        assert_s(10, 0.0);
        assert_s(30, 20.0);
    }
}
