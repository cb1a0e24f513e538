//! Random lines: gradients, curves, tunnels, stations, speed limits, balises.

use dynocar_model::track::{Track, TrackCurve, Tunnel};

use super::random::SimulatorRandom;
use super::settings::{SimulatorSettings, TrainType};
use super::train_maker::rounded;

/// A section with one speed limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedLimit {
    /// Chainage in m where it starts; it holds until the next.
    pub start_m: f64,
    /// Limit in m/s.
    pub speed_mps: f64,
}

/// A line, with properties that the track file lacks.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedLine {
    /// The declared track.
    pub track: Track,
    /// Length in m.
    pub length_m: f64,
    /// Chainages in m of the stations, in order.
    pub stations_m: Vec<f64>,
    /// Speed limits, in order.
    pub limits: Vec<SpeedLimit>,
    /// Chainages in m of the balises, in order.
    pub balises_m: Vec<f64>,
}

impl SimulatedLine {
    /// Returns the lowest speed limit in m/s anywhere under a train.
    pub fn limit_under_mps(&self, centre_m: f64, train_length_m: f64) -> f64 {
        let (rear_m, front_m) = (centre_m - 0.5 * train_length_m, centre_m + 0.5 * train_length_m);
        let first = self.limits.partition_point(|limit| limit.start_m <= rear_m).max(1) - 1;
        self.limits[first..]
            .iter()
            .enumerate()
            .take_while(|(k, limit)| *k == 0 || limit.start_m < front_m)
            .map(|(_, limit)| limit.speed_mps)
            .fold(f64::INFINITY, f64::min)
    }
}

/// Ranges from which a line for one type of train is drawn.
struct Ranges {
    length_m: (f64, f64),
    gradient_length_m: (f64, f64),
    gradient_sd_permille: f64,
    gradient_max_permille: f64,
    curve_gap_m: (f64, f64),
    curve_length_m: (f64, f64),
    radii_m: &'static [f64],
    station_gap_m: (f64, f64),
    /// Beyond the last stations, for trains that overrun.
    end_margin_m: f64,
    limit_length_m: (f64, f64),
    /// Limits as shares of the train's highest speed.
    limit_shares: &'static [f64],
    tunnels: (usize, usize),
    tunnel_length_m: (f64, f64),
    balise_gap_m: (f64, f64),
}

const FREIGHT: Ranges = Ranges {
    length_m: (27e3, 34e3),
    gradient_length_m: (350.0, 1500.0),
    gradient_sd_permille: 4.0,
    gradient_max_permille: 8.0,
    curve_gap_m: (60.0, 1800.0),
    curve_length_m: (250.0, 800.0),
    radii_m: &[350.0, 400.0, 500.0, 600.0, 750.0, 1200.0, 1500.0],
    station_gap_m: (9e3, 15e3),
    end_margin_m: 200.0,
    limit_length_m: (2500.0, 6000.0),
    limit_shares: &[1.0, 0.9, 0.8, 0.75],
    tunnels: (2, 3),
    tunnel_length_m: (1200.0, 3000.0),
    balise_gap_m: (700.0, 1500.0),
};
const REGIONAL: Ranges = Ranges {
    length_m: (27e3, 34e3),
    gradient_length_m: (320.0, 1200.0),
    gradient_sd_permille: 7.0,
    gradient_max_permille: 20.0,
    curve_gap_m: (40.0, 1500.0),
    curve_length_m: (150.0, 700.0),
    radii_m: &[400.0, 500.0, 600.0, 700.0, 850.0, 1000.0, 1600.0, 2200.0],
    station_gap_m: (3.2e3, 5.8e3),
    end_margin_m: 400.0,
    limit_length_m: (1200.0, 4000.0),
    limit_shares: &[1.0, 0.95, 0.9, 0.8, 0.7],
    tunnels: (2, 4),
    tunnel_length_m: (900.0, 2600.0),
    balise_gap_m: (500.0, 1200.0),
};
const METRO: Ranges = Ranges {
    length_m: (13e3, 18e3),
    gradient_length_m: (160.0, 500.0),
    gradient_sd_permille: 7.5,
    gradient_max_permille: 25.0,
    curve_gap_m: (30.0, 900.0),
    curve_length_m: (110.0, 280.0),
    radii_m: &[280.0, 350.0, 450.0, 550.0, 700.0, 900.0, 1200.0],
    station_gap_m: (850.0, 1700.0),
    end_margin_m: 250.0,
    limit_length_m: (700.0, 2500.0),
    limit_shares: &[1.0, 0.95, 0.85, 0.7],
    tunnels: (2, 3),
    tunnel_length_m: (1200.0, 3000.0),
    balise_gap_m: (250.0, 500.0),
};
const HIGH_SPEED: Ranges = Ranges {
    length_m: (54e3, 66e3),
    gradient_length_m: (950.0, 3500.0),
    gradient_sd_permille: 6.0,
    gradient_max_permille: 15.0,
    curve_gap_m: (1000.0, 8000.0),
    curve_length_m: (800.0, 2200.0),
    radii_m: &[6000.0, 8000.0, 9000.0, 10000.0],
    station_gap_m: (20e3, 32e3),
    end_margin_m: 1200.0,
    limit_length_m: (8e3, 20e3),
    limit_shares: &[1.0, 0.97, 0.9, 0.85],
    tunnels: (3, 4),
    tunnel_length_m: (2500.0, 6500.0),
    balise_gap_m: (1000.0, 2500.0),
};

/// The lengths of the lines are for runs of this many s, or shorter ones.
const RANGES_HOLD_S: f64 = 900.0;
/// Lateral acceleration in m/s², cant included, that a speed limit allows in a curve.
const CURVE_ACCELERATION_MPS2: f64 = 1.9;

/// Draws a line for a type of train, long enough for the runs; `train` is its length in m and
/// highest speed in m/s.
///
/// The line is the same with and without tunnels otherwise.
pub fn make_line(
    settings: &SimulatorSettings,
    train_type: TrainType,
    train: (f64, f64),
    has_tunnels: bool,
    random: &mut SimulatorRandom,
) -> SimulatedLine {
    let ranges = match train_type {
        TrainType::Freight => FREIGHT,
        TrainType::Regional => REGIONAL,
        TrainType::Metro => METRO,
        TrainType::HighSpeed => HIGH_SPEED,
    };
    let (train_length_m, speed_max_mps) = train;
    let times_longer = (settings.duration_s / RANGES_HOLD_S).max(1.0);
    let drawn_m = random.uniform(ranges.length_m.0, ranges.length_m.1);
    let length_m = (times_longer * drawn_m).round();
    let mut gradient = make_gradient(&ranges, length_m, random);
    let mut curves = make_curves(&ranges, length_m, random);
    if settings.is_level_and_straight {
        gradient = vec![(0.0, 0.0)];
        curves.clear();
    }
    let tunnels = make_tunnels(&ranges, length_m, random);
    let stations_m = make_stations(&ranges, length_m, train_length_m, random);
    let limits = make_limits(&ranges, length_m, speed_max_mps, &curves, random);
    let balises_m = make_balises(&ranges, length_m, &stations_m, random);
    let track = Track::new(
        format!("{} line of {:.0} km", train_type.name(), length_m / 1000.0),
        Some(length_m),
        Some(&gradient),
        Some(curves),
        Some(if has_tunnels { tunnels } else { Vec::new() }),
    )
    .expect("a generated line is well formed");
    SimulatedLine { track, length_m, stations_m, limits, balises_m }
}

fn make_gradient(ranges: &Ranges, length_m: f64, random: &mut SimulatorRandom) -> Vec<(f64, f64)> {
    let mut gradient = Vec::new();
    let mut chainage_m = 0.0;
    let mut height_m = 0.0;
    while chainage_m < length_m {
        let section_m = random.uniform(ranges.gradient_length_m.0, ranges.gradient_length_m.1);
        // A line stays near one height.
        let pull_permille = -1000.0 * height_m / (0.2 * length_m);
        let drawn = pull_permille + ranges.gradient_sd_permille * random.gaussian();
        let limit = ranges.gradient_max_permille;
        let permille = rounded(drawn.clamp(-limit, limit), 0.1);
        gradient.push((chainage_m, permille));
        chainage_m = (chainage_m + section_m).round();
        height_m += permille * section_m / 1000.0;
    }
    gradient
}

fn make_curves(ranges: &Ranges, length_m: f64, random: &mut SimulatorRandom) -> Vec<TrackCurve> {
    let mut curves = Vec::new();
    let mut free_m = 0.0;
    loop {
        let start_m = (free_m + random.uniform(ranges.curve_gap_m.0, ranges.curve_gap_m.1)).round();
        let drawn_m = random.uniform(ranges.curve_length_m.0, ranges.curve_length_m.1);
        let end_m = (start_m + drawn_m).round();
        if end_m >= length_m {
            return curves;
        }
        curves.push(TrackCurve { start_m, end_m, radius_m: random.pick(ranges.radii_m) });
        free_m = end_m;
    }
}

/// One tunnel in each of as many equal parts of the line's middle.
fn make_tunnels(ranges: &Ranges, length_m: f64, random: &mut SimulatorRandom) -> Vec<Tunnel> {
    let count = random.integer(ranges.tunnels.0, ranges.tunnels.1);
    let part_m = 0.8 * length_m / count as f64;
    (0..count)
        .map(|k| {
            let drawn_m = random.uniform(ranges.tunnel_length_m.0, ranges.tunnel_length_m.1);
            let tunnel_m = drawn_m.min(0.8 * part_m);
            let free_m = part_m - tunnel_m;
            let start_m = 0.1 * length_m + k as f64 * part_m + random.uniform(0.05, 0.95) * free_m;
            Tunnel { start_m: start_m.round(), end_m: (start_m + tunnel_m).round() }
        })
        .collect()
}

fn make_stations(
    ranges: &Ranges,
    length_m: f64,
    train_length_m: f64,
    random: &mut SimulatorRandom,
) -> Vec<f64> {
    let margin_m = 0.5 * train_length_m + ranges.end_margin_m;
    let end_m = length_m - margin_m;
    let mut stations_m = vec![margin_m.round()];
    loop {
        let gap_m = random.uniform(ranges.station_gap_m.0, ranges.station_gap_m.1);
        let next_m = (stations_m[stations_m.len() - 1] + gap_m).round();
        if next_m + 0.6 * ranges.station_gap_m.0 > end_m {
            stations_m.push(end_m.round());
            return stations_m;
        }
        stations_m.push(next_m);
    }
}

/// Draws speed limits, lowered in curves to the speed that their radius allows.
fn make_limits(
    ranges: &Ranges,
    length_m: f64,
    speed_max_mps: f64,
    curves: &[TrackCurve],
    random: &mut SimulatorRandom,
) -> Vec<SpeedLimit> {
    let mut limits = Vec::new();
    let mut chainage_m = 0.0;
    while chainage_m < length_m {
        let section_m = random.uniform(ranges.limit_length_m.0, ranges.limit_length_m.1);
        let end_m = chainage_m + section_m;
        let radius_m = curves
            .iter()
            .filter(|curve| curve.start_m < end_m && curve.end_m > chainage_m)
            .map(|curve| curve.radius_m)
            .fold(f64::INFINITY, f64::min);
        let drawn_mps = speed_max_mps * random.pick(ranges.limit_shares);
        // Limits come in steps of 5 km/h.
        let speed_mps = drawn_mps.min((CURVE_ACCELERATION_MPS2 * radius_m).sqrt());
        let speed_mps = (speed_mps * 3.6 / 5.0).floor() * 5.0 / 3.6;
        limits.push(SpeedLimit { start_m: chainage_m, speed_mps });
        chainage_m = end_m.round();
    }
    limits
}

/// Balises along the line and one at each station.
fn make_balises(
    ranges: &Ranges,
    length_m: f64,
    stations_m: &[f64],
    random: &mut SimulatorRandom,
) -> Vec<f64> {
    let mut balises_m = stations_m.to_vec();
    let mut chainage_m = 0.0;
    while chainage_m < length_m {
        chainage_m += random.uniform(ranges.balise_gap_m.0, ranges.balise_gap_m.1);
        balises_m.push(chainage_m.round());
    }
    balises_m.sort_by(f64::total_cmp);
    balises_m
}
