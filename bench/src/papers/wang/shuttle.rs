//! The train, the line and the drive of Wang 2022's scenario.
//!
//! The paper gives Table 1 (110 t empty) and Table 2 (z1, z2, z3), 200 ms and 28,000 samples a
//! crossing. The line is synthetic: 28 km with four stations, gradients, curves and tunnels,
//! driven to and fro.

use std::sync::Arc;

use dynocar_core::track::{Curve, Track, Tunnel};
use dynocar_core::train::{BrakeGear, Davis, EffortCurve, TrainModel};
use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Time in s between two samples: the controller's period of the paper.
pub const PERIOD_S: f64 = 0.2;
/// Mass in kg of the empty train, Table 1.
pub const EMPTY_MASS_KG: f64 = 110_000.0;
/// Radius in m of every curve of the line: z2 knows no radius.
pub const CURVE_RADIUS_M: f64 = 500.0;
/// Where the train stops, chainage in m.
pub const STATIONS_M: [f64; 4] = [100.0, 3_100.0, 21_300.0, 27_900.0];

const KMH: f64 = 1.0 / 3.6;
const SUBSTEPS: usize = 4;
const FORCE_SLEW_N_PER_S: f64 = 80_000.0;
const SERVICE_BRAKE_MPS2: f64 = 0.7;

/// Basic, curve and tunnel resistance as functions of speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curves {
    /// z1.
    pub basic: Davis,
    /// z2, whole train in a curve.
    pub curve: Davis,
    /// z3, whole train in a tunnel.
    pub tunnel: Davis,
}

impl Curves {
    /// Table 2's means, converted from km/h.
    pub fn table_2() -> Self {
        let from_kmh = |a: f64, b: f64, c: f64| Davis { a, b: b * 3.6, c: c * 12.96 };
        Curves {
            basic: from_kmh(2.845737, 0.015846, 0.000765),
            curve: from_kmh(1.362406, 0.002273, 0.000228),
            tunnel: from_kmh(0.609985, 0.022346, 0.001276),
        }
    }

    /// Resistance in N/kN of a train of which a share is in curves and a share in tunnels.
    pub fn w_n_per_kn(&self, speed_mps: f64, shares: Shares) -> f64 {
        self.basic.w0_n_per_kn(speed_mps)
            + shares.curve * self.curve.w0_n_per_kn(speed_mps)
            + shares.tunnel * self.tunnel.w0_n_per_kn(speed_mps)
    }
}

/// Shares of the train in curves and in tunnels, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shares {
    /// In curves.
    pub curve: f64,
    /// In tunnels.
    pub tunnel: f64,
}

/// The train and the line.
#[derive(Clone, Debug)]
pub struct Shuttle {
    /// The train as declared: gamma 0, no declared curve or tunnel resistance.
    pub train: Arc<TrainModel>,
    /// The line as mapped.
    pub track: Arc<Track>,
    /// The resistances that act.
    pub truth: Curves,
}

/// A state of the train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
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

/// What acts on the train that neither map nor model knows.
pub trait Disturbance {
    /// Resistance in N/kN beyond the model's, at a time and a speed.
    fn resistance_n_per_kn(&mut self, time_s: f64, speed_mps: f64) -> f64;
}

/// Nothing beyond the model.
pub struct Calm;

impl Disturbance for Calm {
    fn resistance_n_per_kn(&mut self, _time_s: f64, _speed_mps: f64) -> f64 {
        0.0
    }
}

impl Shuttle {
    /// The scenario's train and line; `curve_in_tunnel` adds a curve inside the middle tunnel.
    pub fn new(curve_in_tunnel: bool) -> Self {
        let truth = Curves::table_2();
        let effort: Vec<(f64, f64)> = (0..=22)
            .map(|k| {
                let speed_mps = f64::from(5 * k) * KMH;
                (speed_mps, 105_000.0 * (40.0 * KMH / speed_mps).min(1.0))
            })
            .collect();
        let train = TrainModel {
            name: "four-car airport train".into(),
            mass_kg: EMPTY_MASS_KG,
            length_m: 70.0,
            cars: 4,
            rotating_mass_factor: 0.0,
            resistance: truth.basic,
            curve_constant_n_per_kn_m: 0.0,
            tunnel_constant_n_per_kn_m: 0.0,
            traction: EffortCurve::new(effort),
            brake: EffortCurve::new(vec![(0.0, 110_000.0)]),
            brake_gear: BrakeGear::default(),
        };
        let track = Track::new(
            "synthetic 28 km shuttle".into(),
            Some(28_000.0),
            Some(&gradients()),
            Some(curves(curve_in_tunnel)),
            Some(tunnels()),
        )
        .expect("ordered lists");
        Shuttle { train: Arc::new(train), track: Arc::new(track), truth }
    }

    /// Shares of the train in curves and tunnels.
    pub fn shares(&self, position_m: f64) -> Shares {
        let length_m = self.train.length_m;
        let curvature = self.track.curvature_per_m(position_m, length_m).unwrap_or(0.0);
        Shares {
            curve: CURVE_RADIUS_M * curvature,
            tunnel: self.track.tunnel_share(position_m, length_m).unwrap_or(0.0),
        }
    }

    /// Acceleration in m/s² under a force, with `extra` N/kN of resistance.
    pub fn acceleration_mps2(&self, at: &Instant, force_n: f64, extra_n_per_kn: f64) -> f64 {
        let gradient = self.track.gradient_permille(at.position_m, self.train.length_m);
        let w = self.truth.w_n_per_kn(at.speed_mps, self.shares(at.position_m))
            + at.direction * gradient.unwrap_or(0.0)
            + extra_n_per_kn;
        force_n / at.mass_kg - 1e-3 * STANDARD_GRAVITY_MPS2 * w
    }

    /// One sampling period further, the force linear between `from.force_n` and `to_n`; by
    /// Runge and Kutta's fourth order on a quarter of the period.
    fn advance(&self, from: &Instant, to_n: f64, disturbance: &mut dyn Disturbance) -> Instant {
        let extra = disturbance.resistance_n_per_kn(from.time_s, from.speed_mps);
        let step_s = PERIOD_S / SUBSTEPS as f64;
        let slew = (to_n - from.force_n) / PERIOD_S;
        let mut now = *from;
        for _ in 0..SUBSTEPS {
            let slope = |ahead_s: f64, speed_mps: f64, position_m: f64| {
                let at = Instant { speed_mps, position_m, ..now };
                self.acceleration_mps2(&at, now.force_n + slew * ahead_s, extra)
            };
            let (v0, x0, half) = (now.speed_mps, now.position_m, 0.5 * step_s);
            let sign = now.direction;
            let a1 = slope(0.0, v0, x0);
            let v1 = v0 + half * a1;
            let a2 = slope(half, v1, x0 + sign * half * v0);
            let v2 = v0 + half * a2;
            let a3 = slope(half, v2, x0 + sign * half * v1);
            let v3 = v0 + step_s * a3;
            let a4 = slope(step_s, v3, x0 + sign * step_s * v2);
            now.speed_mps = v0 + step_s / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
            now.position_m = x0 + sign * step_s / 6.0 * (v0 + 2.0 * v1 + 2.0 * v2 + v3);
            now.force_n += slew * step_s;
            now.time_s += step_s;
        }
        now
    }

    /// Drives from standstill at `from_m` to standstill at `to_m`, then stands for `dwell_s`.
    ///
    /// The driver powers to the limit, lets the speed fall by 6 km/h while coasting, and brakes
    /// for lower limits and the stop.
    pub fn drive(
        &self,
        start: &Instant,
        to_m: f64,
        dwell_s: f64,
        disturbance: &mut dyn Disturbance,
    ) -> Vec<Instant> {
        let mut now = Instant { speed_mps: 0.0, force_n: 0.0, ..*start };
        now.direction = (to_m - now.position_m).signum();
        let mut driver = Driver { is_powering: true, is_stopping: false };
        let mut ride = vec![now];
        loop {
            let wanted_n = driver.force_n(self, &now, to_m);
            let change = FORCE_SLEW_N_PER_S * PERIOD_S;
            let to_n = wanted_n.clamp(now.force_n - change, now.force_n + change);
            let next = self.advance(&now, to_n, disturbance);
            if next.speed_mps <= 0.0 && now.force_n < 0.0 {
                break;
            }
            // The pull-away: brakes hold the train until the force outweighs the slope.
            now = Instant { speed_mps: next.speed_mps.max(0.0), ..next };
            ride.push(now);
        }
        let standing = (dwell_s / PERIOD_S).round() as usize;
        for _ in 0..standing {
            now.time_s += PERIOD_S;
            (now.speed_mps, now.force_n) = (0.0, -20_000.0);
            ride.push(now);
        }
        ride
    }

    /// Drives to and fro until there are `count` samples, the empty train throughout.
    pub fn crossing(&self, count: usize, disturbance: &mut dyn Disturbance) -> Vec<Instant> {
        let mut ride: Vec<Instant> = Vec::with_capacity(count + 8_000);
        let mut now = self.standing_at(STATIONS_M[0], EMPTY_MASS_KG);
        let mut station = 0_usize;
        let mut is_outbound = true;
        while ride.len() < count {
            station = if is_outbound { station + 1 } else { station - 1 };
            let leg = self.drive(&now, STATIONS_M[station], 30.0, disturbance);
            now = leg[leg.len() - 1];
            now.time_s += PERIOD_S;
            ride.extend(leg);
            is_outbound = match station {
                0 => true,
                3 => false,
                _ => is_outbound,
            };
        }
        ride.truncate(count);
        ride
    }

    /// The train at rest.
    pub fn standing_at(&self, position_m: f64, mass_kg: f64) -> Instant {
        Instant { time_s: 0.0, position_m, speed_mps: 0.0, force_n: 0.0, direction: 1.0, mass_kg }
    }
}

struct Driver {
    is_powering: bool,
    is_stopping: bool,
}

impl Driver {
    fn force_n(&mut self, shuttle: &Shuttle, now: &Instant, to_m: f64) -> f64 {
        let brake_n = |deceleration: f64| (-now.mass_kg * deceleration).max(-110_000.0);
        let stop_m = (now.direction * (to_m - now.position_m)).max(1.0);
        let stop_mps2 = now.speed_mps * now.speed_mps / (2.0 * stop_m);
        self.is_stopping |= stop_mps2 > SERVICE_BRAKE_MPS2;
        if self.is_stopping {
            return brake_n(stop_mps2.clamp(0.5, 1.0));
        }
        let (needed_mps2, limit_mps) = limit_need(now);
        if needed_mps2 > SERVICE_BRAKE_MPS2 || now.speed_mps > limit_mps + 2.0 * KMH {
            self.is_powering = false;
            return brake_n(needed_mps2.clamp(0.4, 1.0));
        }
        if now.speed_mps < limit_mps - 6.0 * KMH {
            self.is_powering = true;
        } else if now.speed_mps > limit_mps - 0.5 * KMH {
            self.is_powering = false;
        }
        let is_near = needed_mps2.max(stop_mps2) > 0.6 * SERVICE_BRAKE_MPS2;
        match &shuttle.train.traction {
            Some(effort) if self.is_powering && !is_near => 0.95 * effort.force_n(now.speed_mps),
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

fn gradients() -> Vec<(f64, f64)> {
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

fn curves(curve_in_tunnel: bool) -> Vec<Curve> {
    let mut random = ChaCha8Rng::seed_from_u64(28_001);
    let mut list = Vec::new();
    let mut start_m = 400.0;
    while start_m < 27_000.0 {
        let end_m = start_m + (250.0 + 350.0 * random.random::<f64>()).round();
        let overlaps =
            |tunnel: &Tunnel| start_m < tunnel.end_m + 80.0 && end_m > tunnel.start_m - 80.0;
        if !tunnels().iter().any(overlaps) {
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

fn tunnels() -> Vec<Tunnel> {
    [(900.0, 2_300.0), (11_200.0, 12_900.0), (18_500.0, 19_600.0), (22_600.0, 24_000.0)]
        .map(|(start_m, end_m)| Tunnel { start_m, end_m })
        .to_vec()
}
