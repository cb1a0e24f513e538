//! Shortest running times by our driving simulation against those of railtoolkit's TrainRuns.jl.
//!
//! The files do not state the resistance and inertia of their trains; both were derived from the results of
//! TrainRuns.jl (resistance force against speed, force against acceleration). Effort curves, speed limits and gradients
//! come from the files. TrainRuns.jl steps 20 m at a time with explicit steps, so that the first seconds of an
//! acceleration differ.

use std::path::Path;

use dynocar_model::simulate::motion::SimulatedMotion;
use dynocar_model::track::Track;
use dynocar_model::train::{BrakeGear, Davis, EffortCurve, TrainModel};
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_tests::simulator::driving::{Controls, TrainOnLine, drive};

use super::Report;

/// Gravity in m/s² of TrainRuns.jl.
pub const THEIR_GRAVITY_MPS2: f64 = 9.80665;
/// Largest relative difference of a running time.
const TOLERANCE: f64 = 0.005;
const STEP_S: f64 = 0.05;

/// A train of TrainRuns.jl, loaded to its limit.
pub struct TheirTrain {
    pub name: &'static str,
    pub length_m: f64,
    /// Inertial mass in kg.
    pub inertia_kg: f64,
    /// Mass in kg that the gradient pulls at.
    pub mass_kg: f64,
    /// Resistance in N, N/(m/s) and N/(m/s)².
    pub resistance: [f64; 3],
    braking_mps2: f64,
    speed_max_mps: f64,
}

/// Their trains, as their results give them.
pub const TRAINS: [TheirTrain; 3] = [
    TheirTrain {
        name: "freight",
        length_m: 204.72,
        inertia_kg: 960_981.818_181_8,
        mass_kg: 920_000.0,
        resistance: [13_435.110_5, 84.729_456, 51.803_589_4],
        braking_mps2: 0.225,
        speed_max_mps: 80.0 / 3.6,
    },
    TheirTrain {
        name: "longdistance",
        length_m: 153.37,
        inertia_kg: 472_873.440_233_2,
        mass_kg: 443_000.0,
        resistance: [9_505.538_77, 282.398_334, 23.043_700_689],
        braking_mps2: 0.375,
        speed_max_mps: 160.0 / 3.6,
    },
    TheirTrain {
        name: "local",
        length_m: 41.7,
        inertia_kg: 95_040.0,
        mass_kg: 88_000.0,
        resistance: [1_703.413_143_7, 28.087_814_664, 3.370_537_76],
        braking_mps2: 0.4253,
        speed_max_mps: 120.0 / 3.6,
    },
];

/// Checks every train on every path.
pub fn check(report: &mut Report, folder: &Path) {
    for train in &TRAINS {
        for path in ["const", "slope", "speed", "realworld"] {
            let outcome = compare(folder, train, path);
            report.note(&format!("TrainRuns.jl: {} on {path}", train.name), outcome);
        }
    }
}

fn compare(folder: &Path, train: &TheirTrain, path: &str) -> Result<String, String> {
    let read = |name: String| {
        std::fs::read_to_string(folder.join(&name)).map_err(|error| format!("{name}: {error}"))
    };
    let effort = pairs(&read(format!("train_{}.yaml", train.name))?, "tractive_effort");
    let sections = pairs(&read(format!("path_{path}.yaml"))?, "characteristic_sections");
    let stated = read(format!("runtime_{}_{path}.csv", train.name))?;
    let stated_s: f64 = stated
        .lines()
        .nth(1)
        .and_then(|line| line.trim().parse().ok())
        .ok_or("no running time stated")?;
    let found_s = running_time_s(train, &effort, &sections).ok_or("the train does not arrive")?;
    let detail = format!("{found_s:.1} s, stated {stated_s:.1} s");
    if (found_s / stated_s - 1.0).abs() <= TOLERANCE { Ok(detail) } else { Err(detail) }
}

/// Returns the rows `- [a, b, …]` under a heading of a YAML file.
fn pairs(text: &str, heading: &str) -> Vec<Vec<f64>> {
    text.lines()
        .map(str::trim)
        .skip_while(|line| !line.starts_with(heading))
        .skip(1)
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .map_while(|line| line.strip_prefix("- [")?.split(']').next())
        .map(|row| row.split(',').filter_map(|cell| cell.trim().parse().ok()).collect())
        .collect()
}

fn running_time_s(train: &TheirTrain, effort: &[Vec<f64>], sections: &[Vec<f64>]) -> Option<f64> {
    let weight_kn = TrainModel::weight_kn(train.mass_kg);
    let [a, b, c] = train.resistance.map(|force| force / weight_kn);
    let model = TrainModel {
        name: train.name.into(),
        mass_kg: train.mass_kg,
        // Their gradient acts on the train as on a point.
        length_m: 0.0,
        cars: 1,
        full_mass_kg: None,
        passenger_mass_kg: 70.0,
        rotating_mass_factor: train.inertia_kg / train.mass_kg - 1.0,
        resistance: Davis { a, b, c },
        curve_constant_n_per_kn_m: 0.0,
        tunnel_constant_n_per_kn_m: 0.0,
        traction: None,
        brake: None,
        drive: None,
        brake_gear: BrakeGear::default(),
        corrections: Default::default(),
        extra: Vec::new(),
    };
    let effort = EffortCurve::new(effort.iter().map(|row| (row[0] / 3.6, row[1])).collect())?;
    let scale = THEIR_GRAVITY_MPS2 / GRAVITY_MPS2;
    let mut gradient: Vec<_> = sections.iter().map(|row| (row[0], row[2] * scale)).collect();
    gradient.dedup_by(|later, earlier| later.0 == earlier.0);
    let track = Track::new(String::new(), None, Some(&gradient), None, None).ok()?;
    let line = TrainOnLine {
        train: &model,
        track: Some(&track),
        mass_kg: train.mass_kg,
        start_m: 0.0,
        direction: 1.0,
    };
    let end_m = sections.last()?[0];
    let permitted = PermittedSpeed::new(train, sections, end_m);
    let mut driver = |_time_s: f64, motion: SimulatedMotion| {
        let has_arrived = motion.distance_m > end_m - 0.02;
        if has_arrived || (motion.distance_m > end_m - 2.0 && motion.speed_mps < 0.02) {
            return None;
        }
        let resisting_n = -line.acceleration_mps2(motion, Controls::default()) * train.inertia_kg;
        let change_mps = permitted.after_step_mps(motion) - motion.speed_mps;
        let wanted_n = change_mps / STEP_S * train.inertia_kg + resisting_n;
        let force_n = wanted_n.min(effort.force_n(motion.speed_mps));
        Some(Controls { traction_force_n: force_n.max(0.0), brake_force_n: (-force_n).max(0.0) })
    };
    let points = drive(&line, &mut driver, STEP_S, 20_000.0);
    points.last().map(|point| point.time_s)
}

/// Highest speed at each metre: the limits, until the rear has cleared them, and the braking
/// curves before lower ones.
struct PermittedSpeed {
    /// Square of the speed at each metre, in (m/s)².
    squares: Vec<f64>,
    end_m: f64,
}

impl PermittedSpeed {
    fn new(train: &TheirTrain, sections: &[Vec<f64>], end_m: f64) -> Self {
        let last = end_m as usize + 1;
        let mut squares = vec![train.speed_max_mps.powi(2); last + 1];
        for pair in sections.windows(2) {
            let cleared_m = pair[1][0] + train.length_m;
            let from = pair[0][0].ceil() as usize;
            for square in &mut squares[from..=(cleared_m.floor() as usize).min(last)] {
                *square = square.min((pair[0][1] / 3.6).powi(2));
            }
        }
        squares[last - 1] = 0.0;
        squares[last] = 0.0;
        for metre in (0..last - 1).rev() {
            squares[metre] = squares[metre].min(squares[metre + 1] + 2.0 * train.braking_mps2);
        }
        PermittedSpeed { squares, end_m }
    }

    fn at_mps(&self, distance_m: f64) -> f64 {
        if distance_m >= self.end_m {
            return 0.0;
        }
        let metre = distance_m as usize;
        let share = distance_m - metre as f64;
        let (here, next) = (self.squares[metre], self.squares[metre + 1]);
        (here + (next - here) * share).sqrt()
    }

    /// Returns the speed permitted where the next step ends, which depends on that speed: by fixed point.
    fn after_step_mps(&self, motion: SimulatedMotion) -> f64 {
        (0..4).fold(motion.speed_mps, |speed_mps, _| {
            self.at_mps(motion.distance_m + 0.5 * STEP_S * (motion.speed_mps + speed_mps))
        })
    }
}
