//! The synthetic line of 28 km.

use dynocar_model::track::{Curve, Tunnel};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Radius in m of every curve: z2 knows no radius.
pub const CURVE_RADIUS_M: f64 = 500.0;
/// Where the train stops, chainage in m.
pub const STATIONS_M: [f64; 4] = [100.0, 3_100.0, 21_300.0, 27_900.0];

/// (chainage in m, ‰): steps of 300 to 900 m, up to 12 ‰ either way.
pub fn gradients() -> Vec<(f64, f64)> {
    let mut random = ChaCha8Rng::seed_from_u64(28_000);
    let mut list = vec![(0.0, 0.0)];
    let mut at_m = 250.0;
    while at_m < 27_700.0 {
        list.push((at_m, (240.0 * random.random::<f64>() - 120.0).round() / 10.0));
        at_m += (300.0 + 600.0 * random.random::<f64>()).round();
    }
    list.push((27_750.0, 0.0));
    list
}

/// Curves of 250 to 600 m outside the tunnels; if wanted, two more inside.
pub fn curves(curve_in_tunnel: bool) -> Vec<Curve> {
    let mut random = ChaCha8Rng::seed_from_u64(28_001);
    let mut list = Vec::new();
    let mut start_m = 400.0;
    while start_m < 27_000.0 {
        let end_m = start_m + (250.0 + 350.0 * random.random::<f64>()).round();
        let is_near =
            |tunnel: &Tunnel| start_m < tunnel.end_m + 80.0 && end_m > tunnel.start_m - 80.0;
        if !tunnels().iter().any(is_near) {
            list.push(Curve { start_m, end_m, radius_m: CURVE_RADIUS_M });
        }
        start_m = end_m + (400.0 + 700.0 * random.random::<f64>()).round();
    }
    if curve_in_tunnel {
        list.push(Curve { start_m: 11_700.0, end_m: 12_300.0, radius_m: CURVE_RADIUS_M });
        list.push(Curve { start_m: 23_000.0, end_m: 23_400.0, radius_m: CURVE_RADIUS_M });
    }
    list
}

/// Four tunnels, a fifth of the line.
pub fn tunnels() -> Vec<Tunnel> {
    [(900.0, 2_300.0), (11_200.0, 12_900.0), (18_500.0, 19_600.0), (22_600.0, 24_000.0)]
        .map(|(start_m, end_m)| Tunnel { start_m, end_m })
        .to_vec()
}
