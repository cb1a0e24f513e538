//! Deviations that the world of ordinary mistakes lacks: brakes, rails, wind, tunnels, curves and loads.

use dynocar_core::pipeline::braking::intake::DeclaredGear;
use dynocar_model::train::{BrakeGear, EffortCurve, TrainModel};
use dynocar_shared::stopping::RailAdhesion;
use dynocar_shared::{RailCondition, Uncertain};
use dynocar_tests::chance::Chance;

use super::knowledge::Ability;
use crate::output::Record;
use crate::scenarios::brake::Brake;
use crate::scenarios::world::{LoadSource, Mistakes, Scenario, Traffic, World};

/// Particular brakes, rail or behaviour of the daemon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    /// In words.
    pub name: &'static str,
    /// Exerted brake force over the force that belongs to the cylinder pressure.
    brake_scale: f64,
    /// True where the rail is wet, and mostly more slippery than the law says.
    is_wet: bool,
    /// True where the daemon is killed in the middle of a leg, and another one is started.
    pub daemon_dies: bool,
}

impl Condition {
    const fn brakes(name: &'static str, brake_scale: f64) -> Self {
        Condition { name, brake_scale, is_wet: false, daemon_dies: false }
    }
}

/// Nothing is particular.
pub const ORDINARY: Condition = Condition::brakes("ordinary", 1.0);
/// All conditions.
pub const CONDITIONS: [Condition; 5] = [
    ORDINARY,
    Condition::brakes("brakes 10 % weaker", 0.9),
    Condition::brakes("brakes 10 % stronger", 1.1),
    Condition { name: "wet rail", is_wet: true, ..ORDINARY },
    Condition { name: "daemon dies", daemon_dies: true, ..ORDINARY },
];

/// A row of the table: kind of traffic and its deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Service {
    /// Kind of traffic.
    pub traffic: Traffic,
    /// Particular condition of this drive.
    pub condition: Condition,
    /// Cycle of the controller in ms.
    pub cycle_ms: u32,
}

impl Service {
    /// In words.
    pub fn name(&self) -> String {
        format!("{}, {}, {} ms", traffic_name(self.traffic), self.condition.name, self.cycle_ms)
    }

    /// Returns the first cells of a row of a table.
    pub fn record(&self) -> Record {
        Record::default()
            .with("train", traffic_name(self.traffic))
            .with("condition", self.condition.name)
            .with("cycle_ms", self.cycle_ms)
    }

    /// Returns the controller's cycle in s.
    pub fn cycle_s(&self) -> f64 {
        f64::from(self.cycle_ms) * 1e-3
    }

    /// Returns the world's scenario: places are those of balises, loads as the kind of traffic knows them.
    pub fn scenario(&self) -> Scenario {
        Scenario {
            traffic: self.traffic,
            load: match self.traffic {
                Traffic::Metro => LoadSource::Changing,
                Traffic::Freight => LoadSource::Unknown,
                Traffic::Emu | Traffic::HighSpeed => LoadSource::Weighed(20),
                Traffic::Tram => LoadSource::Passengers,
            },
            jumps: false,
            rate_hz: 1000 / self.cycle_ms,
            speed_noise_mps: 0.03,
            position_noise_m: 0.05,
            map_std_permille: 0.1,
            brake: Brake::AS_TOLD,
        }
    }

    /// Returns the train as declared, with drive and brake.
    pub fn declared(&self) -> TrainModel {
        let mut train = self.traffic.declared();
        let ability = ability(self.traffic);
        train.brake_gear = gear(ability.brake_max_n);
        train.curve_constant_n_per_kn_m = 600.0;
        train.traction = Some(ability.traction);
        train.brake = EffortCurve::new(vec![(0.0, ability.brake_max_n)]);
        train
    }
}

/// Returns the traffic in words.
pub fn traffic_name(traffic: Traffic) -> &'static str {
    match traffic {
        Traffic::Metro => "metro",
        Traffic::Emu => "regional",
        Traffic::Freight => "freight",
        Traffic::HighSpeed => "high speed",
        Traffic::Tram => "tram",
    }
}

/// Returns the abilities of a train of this traffic with its declared load.
pub fn ability(traffic: Traffic) -> Ability {
    let (habits, train) = (traffic.habits(), traffic.declared());
    let inertial_kg = train.mass_kg * (1.0 + train.rotating_mass_factor);
    let (most, braking_mps2) = habits.acceleration_mps2;
    let power_mps = 0.4 * habits.top_mps;
    let points = (0..=20).map(|k| {
        let speed_mps = power_mps + (1.1 * habits.top_mps - power_mps) * f64::from(k) / 20.0;
        (speed_mps, inertial_kg * most * power_mps / speed_mps)
    });
    let points = [(0.0, inertial_kg * most)].into_iter().chain(points).collect();
    let (jerk_mps3, lag_s) = match traffic {
        Traffic::Metro => (0.8, 0.5),
        Traffic::Tram => (1.4, 0.25),
        Traffic::Emu | Traffic::HighSpeed => (0.5, 0.6),
        Traffic::Freight => (0.1, 2.5),
    };
    Ability {
        traction: EffortCurve::new(points).expect("rising speeds"),
        brake_max_n: FULL_BRAKE * inertial_kg * braking_mps2,
        braking_mps2,
        jerk_mps3,
        lag_s,
    }
}

/// Full over ordinary braking: as much as brings a full train to a stop.
const FULL_BRAKE: f64 = 1.7;
/// Cylinder pressure in Pa of a full braking.
const FULL_PRESSURE_PA: f64 = 400e3;

fn gear(brake_max_n: f64) -> BrakeGear {
    let one_pad = BrakeGear {
        cylinder_diameter_mm: Some(203.0),
        disc_radius_mm: Some(247.0),
        wheel_radius_mm: Some(460.0),
        efficiency: Some(0.9),
        ratio: Some(2.5),
        friction: Some(0.35),
        pads: Some(1.0),
        ..BrakeGear::default()
    };
    let of_one_n = declared_gear(&one_pad).declared_force_n(FULL_PRESSURE_PA);
    BrakeGear { pads: Some(brake_max_n / of_one_n), ..one_pad }
}

/// Brake gear as the daemon assumes it.
pub fn declared_gear(gear: &BrakeGear) -> DeclaredGear {
    DeclaredGear::from_gear(gear).expect("a gear with every quantity")
}

/// Forces that act on the train and stand in no file.
#[derive(Clone, Debug, PartialEq)]
pub struct Hidden {
    /// Exerted over reported brake force, of the train and of all days.
    pub brake_scale: f64,
    /// The rail: its law, and the true adhesion over it.
    pub rail: (RailCondition, f64),
    /// Wind along the growing chainage in m/s: of the day.
    pub wind_mps: f64,
    /// Tunnels: from, to in m; nobody declares them.
    pub tunnels_m: Vec<(f64, f64)>,
    /// Curves: from, to and radius in m; they are declared.
    pub curves_m: Vec<(f64, f64, f64)>,
    /// k of the curve resistance k/R in N/kN.
    pub curve_constant: f64,
}

impl Hidden {
    /// Draws it for a world.
    pub fn draw(service: &Service, world: &World, random: &mut Chance) -> Self {
        let end_m = world.stops_m[world.stops_m.len() - 1];
        let rail = match service.condition.is_wet {
            true => (RailCondition::Wet, (0.75 + 0.1 * random.normal()).clamp(0.55, 1.0)),
            false => (RailCondition::Dry, 1.0 + 0.05 * random.normal()),
        };
        let wind_std_mps = match service.traffic {
            Traffic::Metro | Traffic::Tram => 0.0,
            Traffic::Emu | Traffic::Freight => 3.0,
            Traffic::HighSpeed => 5.0,
        };
        let sections = |count: usize, lengths_m: (f64, f64), random: &mut Chance| {
            let piece_m = end_m / count.max(1) as f64;
            let draw = |k: usize| {
                let length_m = random.between(lengths_m.0, lengths_m.1);
                let from_m = piece_m * k as f64 + 0.5 * random.uniform() * piece_m;
                (from_m, from_m + length_m)
            };
            (0..count).map(draw).collect::<Vec<_>>()
        };
        let tunnels = if service.traffic == Traffic::HighSpeed { 8 } else { 0 };
        let tunnels_m = sections(tunnels, (1e3, 5e3), random);
        let curves = if service.traffic == Traffic::HighSpeed { 0.0 } else { end_m / 1500.0 };
        let curves_m = sections(curves as usize, (200.0, 600.0), random)
            .into_iter()
            .map(|(from_m, to_m)| (from_m, to_m, 350.0 + 900.0 * random.uniform()))
            .collect();
        Hidden {
            brake_scale: service.condition.brake_scale
                * (1.0 + Mistakes::USUAL.brake_share * random.normal()),
            rail,
            wind_mps: wind_std_mps * random.normal(),
            tunnels_m,
            curves_m,
            curve_constant: 600.0 * (1.0 + 0.15 * random.normal()),
        }
    }

    /// Curvature in 1/m at a chainage in m.
    pub fn curvature_per_m(&self, chainage_m: f64) -> f64 {
        let here =
            self.curves_m.iter().find(|(from_m, to_m, _)| (*from_m..*to_m).contains(&chainage_m));
        here.map_or(0.0, |(.., radius_m)| 1.0 / radius_m)
    }

    /// Returns the tunnels' addition to the air resistance, as a share of it.
    pub fn tunnel_share(&self, chainage_m: f64) -> f64 {
        let is_inside = |tunnel: &(f64, f64)| (tunnel.0..tunnel.1).contains(&chainage_m);
        if self.tunnels_m.iter().any(is_inside) { 0.4 } else { 0.0 }
    }

    /// Returns the adhesion's law with the exact scale.
    pub fn adhesion(&self) -> RailAdhesion {
        let (law, scale) = self.rail;
        RailAdhesion::Law(law, Uncertain::exact(scale))
    }
}

/// Returns the gross mass in kg of the next load.
pub fn next_load_kg(traffic: Traffic, before_kg: f64, random: &mut Chance) -> f64 {
    match traffic {
        // From empty to full.
        Traffic::Metro => traffic.declared().mass_kg * (0.8 + 0.5 * random.uniform()),
        _ => before_kg,
    }
}
