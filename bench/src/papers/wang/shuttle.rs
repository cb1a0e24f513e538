//! The train and the line of Wang 2022's scenario.
//!
//! The paper gives Table 1 (110 t empty), Table 2 (z1, z2, z3), a period of 200 ms and 28,000 samples a crossing. The
//! line is synthetic: 28 km with four stations, gradients, curves and tunnels, driven in both directions.

use std::sync::Arc;

use dynocar_model::simulate::motion::{SimulatedMotion, advance};
use dynocar_model::track::{Track, TrackCurve, Tunnel};
use dynocar_model::train::{Davis, EffortCurve, TrainModel};
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_tests::chance::Chance;

use crate::statistics::KMH;

/// Time in s between two samples: the controller's period of the paper.
pub const PERIOD_S: f64 = 0.2;
/// Mass in kg of the empty train, Table 1.
pub const EMPTY_MASS_KG: f64 = 110_000.0;

/// Greatest brake force in N.
pub const BRAKE_MAX_N: f64 = 110_000.0;

/// Table 2's means, converted from km/h: basic resistance z1, z2 of the whole train in a curve, z3 in a tunnel.
pub const TABLE_2: [Davis; 3] = {
    const fn from_kmh(a: f64, b: f64, c: f64) -> Davis {
        Davis { a, b: b * 3.6, c: c * 12.96 }
    }
    [
        from_kmh(2.845737, 0.015846, 0.000765),
        from_kmh(1.362406, 0.002273, 0.000228),
        from_kmh(0.609985, 0.022346, 0.001276),
    ]
};

/// The train and the line.
#[derive(Clone, Debug)]
pub struct Shuttle {
    /// The train as declared: gamma 0, no declared curve or tunnel resistance.
    pub train: Arc<TrainModel>,
    /// The line as mapped.
    pub track: Arc<Track>,
    /// The resistances that act: z1, z2 and z3.
    pub truth: [Davis; 3],
    /// 1 + gamma as it is; the train is declared with gamma = 0.
    pub inertia_factor: f64,
}

/// A state of the train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShuttleMoment {
    /// Time in s.
    pub time_s: f64,
    /// Chainage of the centre in m.
    pub position_m: f64,
    /// Speed in m/s.
    pub speed_mps: f64,
    /// Traction minus brake in N.
    pub force_n: f64,
    /// +1 or -1.
    pub direction: f64,
    /// Mass in kg.
    pub mass_kg: f64,
}

/// Disturbance of the train that neither map nor model knows: resistance in N/kN beyond the model's at a speed in
/// m/s, asked for once a period.
pub type DisturbanceLaw<'a> = dyn FnMut(f64) -> f64 + 'a;

/// Returns nothing beyond the model.
pub fn calm(_speed_mps: f64) -> f64 {
    0.0
}

impl Shuttle {
    /// Returns the scenario's train and line; `curve_in_tunnel` adds a curve inside the middle tunnel.
    pub fn new(curve_in_tunnel: bool) -> Self {
        let effort: Vec<(f64, f64)> = (0..=22)
            .map(|k| {
                let speed_mps = f64::from(5 * k) * KMH;
                (speed_mps, 105_000.0 * (40.0 * KMH / speed_mps).min(1.0))
            })
            .collect();
        let train = TrainModel {
            length_m: 70.0,
            cars: 4,
            traction: EffortCurve::new(effort),
            brake: EffortCurve::new(vec![(0.0, BRAKE_MAX_N)]),
            ..TrainModel::bare("four-car airport train", EMPTY_MASS_KG, TABLE_2[0])
        };
        let track = Track::new(
            "synthetic 28 km shuttle".into(),
            Some(28_000.0),
            Some(&gradients()),
            Some(curves(curve_in_tunnel)),
            Some(tunnels()),
        )
        .expect("ordered lists");
        let (train, track) = (Arc::new(train), Arc::new(track));
        Shuttle { train, track, truth: TABLE_2, inertia_factor: 1.0 }
    }

    /// Shares of the train, 0 to 1, to which z1, z2 and z3 apply.
    pub fn shares(&self, position_m: f64) -> [f64; 3] {
        let length_m = self.train.length_m;
        let curvature = self.track.curvature_per_m(position_m, length_m).unwrap_or(0.0);
        let tunnel = self.track.tunnel_share(position_m, length_m).unwrap_or(0.0);
        [1.0, CURVE_RADIUS_M * curvature, tunnel]
    }

    /// Returns a figure of z1, z2 and z3, summed by the shares of a train at a chainage in m.
    pub fn sum(&self, position_m: f64, of: impl Fn(&Davis) -> f64) -> f64 {
        let shares = self.shares(position_m);
        self.truth.iter().zip(shares).map(|(davis, share)| share * of(davis)).sum()
    }

    /// Returns the acceleration in m/s² with `extra` N/kN of resistance.
    pub fn acceleration_mps2(&self, at: &ShuttleMoment, extra_n_per_kn: f64) -> f64 {
        let gradient = self.track.gradient_permille(at.position_m, self.train.length_m);
        let w = self.sum(at.position_m, |davis| davis.w0_n_per_kn(at.speed_mps))
            + at.direction * gradient.unwrap_or(0.0)
            + extra_n_per_kn;
        (at.force_n / at.mass_kg - 1e-3 * GRAVITY_MPS2 * w) / self.inertia_factor
    }

    /// One sampling period further, the force linear between `from.force_n` and `to_n`.
    pub fn advance(
        &self,
        from: &ShuttleMoment,
        to_n: f64,
        disturbance: &mut DisturbanceLaw<'_>,
    ) -> ShuttleMoment {
        let extra = disturbance(from.speed_mps);
        let slew_n_per_s = (to_n - from.force_n) / PERIOD_S;
        let at = |ahead_s: f64, motion: SimulatedMotion| ShuttleMoment {
            time_s: from.time_s + ahead_s,
            position_m: from.position_m + from.direction * motion.distance_m,
            speed_mps: motion.speed_mps,
            force_n: from.force_n + slew_n_per_s * ahead_s,
            ..*from
        };
        let start = SimulatedMotion { distance_m: 0.0, speed_mps: from.speed_mps };
        let end = advance(start, PERIOD_S, |ahead_s, motion| {
            self.acceleration_mps2(&at(ahead_s, motion), extra)
        });
        at(PERIOD_S, end)
    }

    /// Returns the train at rest.
    pub fn standing_at(&self, position_m: f64, mass_kg: f64) -> ShuttleMoment {
        ShuttleMoment {
            time_s: 0.0,
            position_m,
            speed_mps: 0.0,
            force_n: 0.0,
            direction: 1.0,
            mass_kg,
        }
    }
}

/// Radius in m of every curve: z2 knows no radius.
pub const CURVE_RADIUS_M: f64 = 500.0;
/// Where the train stops, chainage in m.
pub const STATIONS_M: [f64; 4] = [100.0, 3_100.0, 21_300.0, 27_900.0];

/// (chainage in m, ‰): steps of 300 to 900 m, up to 12 ‰ either way.
fn gradients() -> Vec<(f64, f64)> {
    let mut random = Chance::new(28_000);
    let mut list = vec![(0.0, 0.0)];
    let mut at_m = 250.0;
    while at_m < 27_700.0 {
        list.push((at_m, (240.0 * random.uniform() - 120.0).round() / 10.0));
        at_m += (300.0 + 600.0 * random.uniform()).round();
    }
    list.push((27_750.0, 0.0));
    list
}

/// Curves of 250 to 600 m outside the tunnels; if wanted, two more inside.
fn curves(curve_in_tunnel: bool) -> Vec<TrackCurve> {
    let mut random = Chance::new(28_001);
    let mut list = Vec::new();
    let mut start_m = 400.0;
    while start_m < 27_000.0 {
        let end_m = start_m + (250.0 + 350.0 * random.uniform()).round();
        let is_near =
            |tunnel: &Tunnel| start_m < tunnel.end_m + 80.0 && end_m > tunnel.start_m - 80.0;
        if !tunnels().iter().any(is_near) {
            list.push(TrackCurve { start_m, end_m, radius_m: CURVE_RADIUS_M });
        }
        start_m = end_m + (400.0 + 700.0 * random.uniform()).round();
    }
    if curve_in_tunnel {
        list.push(TrackCurve { start_m: 11_700.0, end_m: 12_300.0, radius_m: CURVE_RADIUS_M });
        list.push(TrackCurve { start_m: 23_000.0, end_m: 23_400.0, radius_m: CURVE_RADIUS_M });
    }
    list
}

/// Four tunnels, a fifth of the line.
fn tunnels() -> Vec<Tunnel> {
    [(900.0, 2_300.0), (11_200.0, 12_900.0), (18_500.0, 19_600.0), (22_600.0, 24_000.0)]
        .map(|(start_m, end_m)| Tunnel { start_m, end_m })
        .to_vec()
}
