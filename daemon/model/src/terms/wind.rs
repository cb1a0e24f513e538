//! Wind along the line: air resistance c (v + u)|v + u| with the headwind u, whose sign turns with
//! the direction of travel, on the part of the train outside tunnels.

use dynocar_shared::vocabulary::EffectKind;

use super::{Parameter, Resistance, Suspect, SuspectInput};
pub use crate::train::numbers::WIND_PLUS;

/// Faster wind stops rail traffic.
pub const PARAMETER: Parameter = Parameter::new("wind_plus_mps", (-35.0, 35.0), 0.05);
/// Root mean square in m/s of the winds along a line on ordinary days, at most.
pub const EVERYDAY_MPS: f64 = 2.5;
/// Standard deviation of gusts over that of the wind from day to day.
pub const GUST_SHARE: f64 = 0.5;
/// Time in s over which a gust lasts on the average, seen from a moving train.
pub const GUST_TIME_S: f64 = 10.0;
/// A weaker wind is lost in the noise of any day.
pub const LEAST_MPS: f64 = 1.0;

/// Adds the headwind on a train in a direction of travel.
#[inline]
pub fn act(wind_plus_mps: f64, direction: f64, resistance: &mut Resistance) {
    resistance.headwind_mps += wind_plus_mps * direction;
}

/// Returns the addition of a small headwind at a speed in m/s, in N/kN for each m/s of it, with a share of the
/// train in tunnels.
#[inline]
pub fn slope_n_per_kn(c: f64, speed_mps: f64, tunnel_share: f64) -> f64 {
    2.0 * (1.0 - tunnel_share) * c * speed_mps
}

/// Unit: 1 m/s, as far as a little wind acts in proportion to its speed.
pub const SUSPECT: Suspect = Suspect::new(EffectKind::Wind, 5.0, |seen| unit(seen, seen.direction));

/// The wind of one day: a headwind in one run, in either direction of travel.
pub const OF_THE_DAY: Suspect = Suspect { unit: |seen| unit(seen, 1.0), ..SUSPECT };

/// Returns the addition of 1 m/s along the line, in N/kN.
fn unit(seen: &SuspectInput, direction: f64) -> f64 {
    let blows = |wind_plus_mps: f64| {
        let mut air = Resistance::BASIC;
        super::tunnel::enter(seen.tunnel_share, &mut air);
        act(wind_plus_mps, direction, &mut air);
        air.extra_n_per_kn(seen.davis, seen.speed_mps)
    };
    0.5 * (blows(1.0) - blows(-1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::Davis;

    #[test]
    fn the_slope_is_what_a_little_wind_adds() {
        let davis = Davis { a: 1.5, b: 0.01, c: 0.0008 };
        for (speed_mps, tunnel_share) in [(5.0, 0.0), (30.0, 0.4), (80.0, 1.0)] {
            let by_wind = |wind_plus_mps: f64| {
                let mut air = Resistance::BASIC;
                super::super::tunnel::enter(Some(tunnel_share), &mut air);
                act(wind_plus_mps, 1.0, &mut air);
                air.extra_n_per_kn(davis, speed_mps)
            };
            let slope = (by_wind(1e-3) - by_wind(-1e-3)) / 2e-3;
            assert!((slope - slope_n_per_kn(davis.c, speed_mps, tunnel_share)).abs() < 1e-9);
        }
    }
}
