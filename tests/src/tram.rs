//! Samples of a tram from stop to stop: an electric brake with a limited change of force, then a friction brake that
//! follows its report late.

use dynocar_model::simulate::motion::deceleration_mps2;
use dynocar_model::simulate::motion::{lagged_explicitly, shown};
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{SampleField, TrainId, TrainSample};

use crate::simulator::actuators::slewed;
use crate::simulator::random::{SimulatorRandom, Stream};

/// Samples per second.
pub const RATE_HZ: u32 = 20;
/// Declared mass in kg.
const TARE_KG: f64 = 38e3;
/// Mass in t with the passengers.
pub const LOADED_T: f64 = 43.0;
const LOADED_KG: f64 = 1e3 * LOADED_T;
const ROTATING: f64 = 0.10;
const LENGTH_M: f64 = 30.0;
const STOPS_M: f64 = 400.0;
const TOP_MPS: f64 = 12.0;
const STANDS_S: f64 = 20.0;
/// Greatest change of the electric force in N/s.
const JERK_NPS: f64 = 55e3;
/// Time constant in s of the friction brake.
const FRICTION_LAG_S: f64 = 0.06;
/// Below this speed in m/s friction takes over from the electric brake.
const FRICTION_MPS: f64 = 1.5;
const HOLDING_N: f64 = 45e3;
const GRAVITY_MPS2: f64 = 9.806_65;

/// The same as a file.
pub const FILE: &str = "\
[train]
name = \"tram\"
mass_t = 38.0
length_m = 30.0
rotating_mass_factor = 0.10

[resistance]
a = 4.0
b = 0.05
c = 0.004
";

/// Returns the tram as its owner declares it.
pub fn declared() -> TrainModel {
    let davis = Davis { a: 4.0, b: 0.05, c: 0.004 };
    TrainModel {
        rotating_mass_factor: ROTATING,
        length_m: LENGTH_M,
        ..TrainModel::bare("tram", TARE_KG, davis)
    }
}

/// Returns the gradient in ‰ at a chainage.
fn gradient_permille(place_m: f64) -> f64 {
    [0.0, 30.0, -12.0, 60.0, -45.0, 8.0, -30.0][(place_m / 150.0) as usize % 7]
}

/// Returns the samples of the tram over a duration.
pub fn samples(seed: u64, duration_s: u32) -> Vec<TrainSample> {
    let mut random = SimulatorRandom::new(seed, Stream::Train);
    let step_s = 0.1 / f64::from(RATE_HZ);
    let (mut place_m, mut speed_mps, mut left_s) = (0.0, 0.0, 5.0);
    // Electric force, and friction as reported and as it acts, in N.
    let (mut electric_n, mut reported_n, mut friction_n) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (mut next_m, mut is_braking) = (STOPS_M, false);
    let mut sample = TrainSample::empty(TrainId(1));
    let mut written = Vec::new();
    for cycle in 0..u64::from(duration_s * RATE_HZ) {
        for _ in 0..10 {
            let to_stop_m: f64 = next_m - place_m;
            let needed_mps2 = deceleration_mps2((speed_mps, 0.0), to_stop_m.max(0.3));
            let (wanted_n, wanted_friction_n) = if left_s > 0.0 {
                left_s -= step_s;
                (0.0, if left_s > 0.0 { HOLDING_N } else { 0.0 })
            } else if is_braking || needed_mps2 > 0.9 {
                is_braking = true;
                let brake_n = LOADED_KG * needed_mps2.clamp(0.5, 1.3);
                if speed_mps < FRICTION_MPS { (0.0, brake_n) } else { (-brake_n, 0.0) }
            } else if speed_mps < TOP_MPS {
                (LOADED_KG * 1.0_f64.min(3.0 * (TOP_MPS - speed_mps)), 0.0)
            } else {
                (0.0, 0.0)
            };
            electric_n = slewed(electric_n, wanted_n, JERK_NPS * step_s);
            reported_n = wanted_friction_n;
            friction_n = lagged_explicitly(friction_n, reported_n, step_s, FRICTION_LAG_S);
            let weight_kn = 1e-3 * GRAVITY_MPS2 * LOADED_KG;
            let resists = 5.0 + 0.06 * speed_mps + 0.0048 * speed_mps * speed_mps;
            let gradient = 0.5
                * (gradient_permille(place_m) + gradient_permille((place_m - LENGTH_M).max(0.0)));
            let force_n = electric_n - friction_n - weight_kn * (resists + gradient);
            if left_s <= 0.0 {
                let change_mps = step_s * force_n / (LOADED_KG * (1.0 + ROTATING));
                let next_mps = (speed_mps + change_mps).max(0.0);
                place_m += 0.5 * step_s * (speed_mps + next_mps);
                speed_mps = next_mps;
                if is_braking && speed_mps < 0.05 {
                    (speed_mps, left_s, is_braking) = (0.0, STANDS_S, false);
                    (next_m, electric_n) = (place_m + STOPS_M, 0.0);
                }
            }
        }
        sample.sequence = cycle + 1;
        sample.time_ns = 1_000_000_000 + (cycle as i64 + 1) * 1_000_000_000 / i64::from(RATE_HZ);
        let noise_mps = 0.008 * random.gaussian();
        sample.set(SampleField::Speed, shown(speed_mps, || speed_mps + noise_mps));
        sample.set(SampleField::Position, place_m + 0.5 * random.gaussian());
        sample.set(SampleField::TractionForce, 1.006 * electric_n.max(0.0));
        sample.set(SampleField::BrakeForce, 1.01 * (reported_n - electric_n.min(0.0)));
        let map = 0.5 * (place_m / 170.0).sin() + 0.3 * (place_m / 61.0).sin();
        let here =
            0.5 * (gradient_permille(place_m) + gradient_permille((place_m - LENGTH_M).max(0.0)));
        sample.set(SampleField::Gradient, here + map);
        written.push(sample);
    }
    written
}
