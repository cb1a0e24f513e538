//! How the train is driven.

use super::shuttle::{BRAKE_MAX_N, Instant, Shuttle};
use crate::statistics::KMH;

const SERVICE_BRAKE_MPS2: f64 = 0.7;

/// Decides on traction minus brake in N that is wanted now on the way to a stop at a chainage in m.
pub type Driver<'a> = dyn FnMut(&Shuttle, &Instant, f64) -> f64 + 'a;

/// Powers to the limit, lets the speed fall by 6 km/h while coasting, brakes for lower limits
/// and for the stop.
pub fn limit_driver() -> impl FnMut(&Shuttle, &Instant, f64) -> f64 {
    let (mut is_powering, mut is_stopping) = (true, false);
    move |shuttle, now, to_m| {
        let brake_n = |deceleration: f64| (-now.mass_kg * deceleration).max(-BRAKE_MAX_N);
        let stop_m = (now.direction * (to_m - now.position_m)).max(1.0);
        let stop_mps2 = now.speed_mps * now.speed_mps / (2.0 * stop_m);
        is_stopping |= stop_mps2 > SERVICE_BRAKE_MPS2;
        if is_stopping {
            return brake_n(stop_mps2.clamp(0.5, 1.0));
        }
        let (needed_mps2, limit_mps) = limit_need(now);
        if needed_mps2 > SERVICE_BRAKE_MPS2 || now.speed_mps > limit_mps + 2.0 * KMH {
            is_powering = false;
            return brake_n(needed_mps2.clamp(0.4, 1.0));
        }
        if now.speed_mps < limit_mps - 6.0 * KMH {
            is_powering = true;
        } else if now.speed_mps > limit_mps - 0.5 * KMH {
            is_powering = false;
        }
        let is_near = needed_mps2.max(stop_mps2) > 0.6 * SERVICE_BRAKE_MPS2;
        match &shuttle.train.traction {
            Some(effort) if is_powering && !is_near => 0.95 * effort.force_n(now.speed_mps),
            _ => 0.0,
        }
    }
}

/// Greatest deceleration in m/s² that a lower limit ahead asks for, and the limit here in m/s.
fn limit_need(now: &Instant) -> (f64, f64) {
    let mut needed = 0.0_f64;
    let mut here_mps = f64::INFINITY;
    for (start_m, end_m, limit_kmh) in limits() {
        let limit_mps = limit_kmh * KMH;
        if (start_m..end_m).contains(&now.position_m) {
            here_mps = limit_mps;
        }
        let entry_m = if now.direction > 0.0 { start_m } else { end_m };
        let ahead_m = now.direction * (entry_m - now.position_m);
        if ahead_m > 0.0 && now.speed_mps > limit_mps {
            let surplus = now.speed_mps * now.speed_mps - limit_mps * limit_mps;
            needed = needed.max(surplus / (2.0 * ahead_m.max(0.5)));
        }
    }
    (needed, here_mps)
}

/// (from m, to m, km/h).
fn limits() -> [(f64, f64, f64); 8] {
    [
        (-1e9, 3_100.0, 80.0),
        (3_100.0, 7_500.0, 105.0),
        (7_500.0, 10_000.0, 70.0),
        (10_000.0, 15_000.0, 100.0),
        (15_000.0, 17_500.0, 55.0),
        (17_500.0, 21_300.0, 90.0),
        (21_300.0, 25_000.0, 75.0),
        (25_000.0, 1e9, 60.0),
    ]
}
