//! Random trains of four types.

use dynocar_model::simulate::motion::quantised;
use dynocar_model::train::{BrakeGear, Davis, EffortCurve, TrainModel};

use super::random::SimulatorRandom;
use super::settings::TrainType;

/// A car as the simulator sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Car {
    /// Share of the train's mass.
    pub mass_share: f64,
    /// Share of the train's length.
    pub length_share: f64,
    /// Length in m.
    pub length_m: f64,
    /// Distance in m of its centre ahead of the train's centre.
    pub ahead_m: f64,
}

/// Response of a train's drives and brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainHandling {
    /// Highest speed in m/s.
    pub speed_max_mps: f64,
    /// Ordinary deceleration in m/s² for stops.
    pub braking_mps2: f64,
    /// Rate in m/s³ at which commands change.
    pub jerk_mps3: f64,
    /// Lag in s of the traction force.
    pub traction_lag_s: f64,
    /// Lag in s of the brake force.
    pub brake_lag_s: f64,
    /// Share of the brake force that electric braking gives at most.
    pub electric_share: f64,
    /// Share of the greatest brake force that holds the train at rest.
    pub holding_share: f64,
    /// Lag in s of the brake cylinders behind the brake force.
    pub cylinder_lag_s: f64,
    /// Cylinder pressure in Pa at the greatest brake force.
    pub cylinder_pressure_full_pa: f64,
}

/// A train with its truth.
#[derive(Clone, Debug, PartialEq)]
pub struct TrueTrain {
    /// The kind of train.
    pub train_type: TrainType,
    /// Declared train.
    pub declared: TrainModel,
    /// The true Davis coefficients, a few percent off the declared ones.
    pub resistance: Davis,
    /// The cars, first one ahead.
    pub cars: Vec<Car>,
    /// Drives and brakes.
    pub handling: TrainHandling,
}

impl TrueTrain {
    /// Returns the unit basic resistance in N/kN at an ordinary speed.
    pub fn ordinary_w0_n_per_kn(&self) -> f64 {
        self.resistance.w0_n_per_kn(0.65 * self.handling.speed_max_mps)
    }

    /// Returns the greatest declared traction force in N at a speed in m/s.
    pub fn traction_max_n(&self, speed_mps: f64) -> f64 {
        self.declared.traction.as_ref().map_or(0.0, |effort| effort.force_n(speed_mps))
    }

    /// Returns the greatest declared brake force in N at a speed in m/s.
    pub fn brake_max_n(&self, speed_mps: f64) -> f64 {
        self.declared.brake.as_ref().map_or(0.0, |effort| effort.force_n(speed_mps))
    }
}

/// Ranges from which a train of one type is drawn.
struct Ranges {
    cars: (usize, usize),
    car_mass_kg: (f64, f64),
    car_length_m: (f64, f64),
    a: (f64, f64),
    b: (f64, f64),
    c: (f64, f64),
    rotating_mass_factor: f64,
    speed_max_mps: (f64, f64),
    /// Starting acceleration and greatest deceleration in m/s².
    pull_mps2: (f64, f64),
    retard_mps2: (f64, f64),
    /// Power in W per kg.
    power_w_per_kg: (f64, f64),
    braking_mps2: f64,
    jerk_mps3: f64,
    lags_s: (f64, f64),
    electric_share: f64,
    holding_share: f64,
}

const FREIGHT: Ranges = Ranges {
    cars: (16, 28),
    car_mass_kg: (62e3, 90e3),
    car_length_m: (13.0, 16.5),
    a: (1.2, 1.7),
    b: (0.008, 0.016),
    c: (0.0007, 0.0012),
    rotating_mass_factor: 0.04,
    speed_max_mps: (22.2, 27.8),
    pull_mps2: (0.16, 0.19),
    retard_mps2: (0.6, 0.75),
    power_w_per_kg: (3.2, 3.8),
    braking_mps2: 0.3,
    jerk_mps3: 0.08,
    lags_s: (0.9, 2.5),
    electric_share: 0.0,
    holding_share: 0.3,
};
const REGIONAL: Ranges = Ranges {
    cars: (2, 5),
    car_mass_kg: (25e3, 32e3),
    car_length_m: (16.0, 19.5),
    a: (1.55, 1.95),
    b: (0.018, 0.03),
    c: (0.0044, 0.0056),
    rotating_mass_factor: 0.07,
    speed_max_mps: (38.9, 44.5),
    pull_mps2: (0.85, 1.05),
    retard_mps2: (1.05, 1.2),
    power_w_per_kg: (13.0, 17.0),
    braking_mps2: 0.65,
    jerk_mps3: 0.5,
    lags_s: (0.4, 0.6),
    electric_share: 0.75,
    holding_share: 0.28,
};
const METRO: Ranges = Ranges {
    cars: (4, 8),
    car_mass_kg: (29e3, 35e3),
    car_length_m: (17.0, 21.0),
    a: (1.7, 2.2),
    b: (0.022, 0.034),
    c: (0.0038, 0.005),
    rotating_mass_factor: 0.08,
    speed_max_mps: (20.8, 25.0),
    pull_mps2: (1.0, 1.2),
    retard_mps2: (1.15, 1.3),
    power_w_per_kg: (11.0, 14.0),
    braking_mps2: 0.8,
    jerk_mps3: 0.7,
    lags_s: (0.3, 0.4),
    electric_share: 0.85,
    holding_share: 0.28,
};
const HIGH_SPEED: Ranges = Ranges {
    cars: (8, 8),
    car_mass_kg: (58e3, 70e3),
    car_length_m: (24.5, 26.0),
    a: (0.65, 0.9),
    b: (0.007, 0.013),
    c: (0.0013, 0.0018),
    rotating_mass_factor: 0.06,
    speed_max_mps: (69.4, 84.0),
    pull_mps2: (0.5, 0.6),
    retard_mps2: (0.85, 1.0),
    power_w_per_kg: (15.0, 18.0),
    braking_mps2: 0.5,
    jerk_mps3: 0.4,
    lags_s: (0.5, 0.7),
    electric_share: 0.7,
    holding_share: 0.28,
};

/// Draws a train; `resistance_spread` scales the distance of its true Davis coefficients from the
/// declared ones.
pub fn make_train(
    train_type: TrainType,
    resistance_spread: f64,
    random: &mut SimulatorRandom,
) -> TrueTrain {
    let ranges = match train_type {
        TrainType::Freight => FREIGHT,
        TrainType::Regional => REGIONAL,
        TrainType::Metro => METRO,
        TrainType::HighSpeed => HIGH_SPEED,
    };
    let cars = make_cars(train_type, &ranges, random);
    let (mass_kg, length_m) = (cars.0, cars.1);
    let draw = |range: (f64, f64), random: &mut SimulatorRandom| random.uniform(range.0, range.1);
    let declared_resistance = Davis {
        a: rounded(draw(ranges.a, random), 1e-3),
        b: rounded(draw(ranges.b, random), 1e-4),
        c: rounded(draw(ranges.c, random), 1e-5),
    };
    let mut off = |share: f64| 1.0 + resistance_spread * share * random.uniform(-1.0, 1.0);
    let resistance = Davis {
        a: declared_resistance.a * off(0.05),
        b: declared_resistance.b * off(0.05),
        c: declared_resistance.c * off(0.08),
    };
    let speed_max_mps = rounded(draw(ranges.speed_max_mps, random), 0.1);
    let traction = traction_effort(&ranges, mass_kg, speed_max_mps, random);
    let brake_max_n = rounded(mass_kg * draw(ranges.retard_mps2, random), 1e3);
    let declared = TrainModel {
        name: format!("{} train of {} cars", train_type.name(), cars.2.len()),
        mass_kg,
        length_m,
        cars: cars.2.len() as u32,
        full_mass_kg: None,
        passenger_mass_kg: 70.0,
        rotating_mass_factor: ranges.rotating_mass_factor,
        resistance: declared_resistance,
        curve_constant_n_per_kn_m: 600.0,
        tunnel_constant_n_per_kn_m: 0.0,
        traction: EffortCurve::new(traction),
        brake: EffortCurve::new(vec![(0.0, brake_max_n)]),
        drive: None,
        brake_gear: BrakeGear::default(),
        corrections: Default::default(),
        extra: Vec::new(),
    };
    let handling = TrainHandling {
        speed_max_mps,
        braking_mps2: ranges.braking_mps2,
        jerk_mps3: ranges.jerk_mps3,
        traction_lag_s: ranges.lags_s.0,
        brake_lag_s: ranges.lags_s.1,
        electric_share: ranges.electric_share,
        holding_share: ranges.holding_share,
        cylinder_lag_s: 0.3,
        cylinder_pressure_full_pa: 380e3,
    };
    TrueTrain { train_type, declared, resistance, cars: cars.2, handling }
}

/// Returns the mass in kg, length in m and cars; a freight train has its locomotive ahead.
fn make_cars(
    train_type: TrainType,
    ranges: &Ranges,
    random: &mut SimulatorRandom,
) -> (f64, f64, Vec<Car>) {
    let count = random.integer(ranges.cars.0, ranges.cars.1);
    let uniform_length_m = random.uniform(ranges.car_length_m.0, ranges.car_length_m.1);
    let uniform_mass_kg = random.uniform(ranges.car_mass_kg.0, ranges.car_mass_kg.1);
    let mut sizes: Vec<(f64, f64)> = (0..count)
        .map(|_| match train_type {
            TrainType::Freight => {
                (random.uniform(ranges.car_mass_kg.0, ranges.car_mass_kg.1), uniform_length_m)
            }
            _ => (uniform_mass_kg * random.uniform(0.93, 1.07), uniform_length_m),
        })
        .collect();
    if train_type == TrainType::Freight {
        sizes.insert(0, (85e3, 19.0));
    }
    let exact_mass_kg: f64 = sizes.iter().map(|size| size.0).sum();
    let exact_length_m: f64 = sizes.iter().map(|size| size.1).sum();
    let length_m = rounded(exact_length_m, 0.1);
    let stretch = length_m / exact_length_m;
    let mut front_m = 0.5 * length_m;
    let cars = sizes
        .into_iter()
        .map(|(mass_kg, car_length_m)| {
            let car_length_m = stretch * car_length_m;
            let ahead_m = front_m - 0.5 * car_length_m;
            front_m -= car_length_m;
            Car {
                mass_share: mass_kg / exact_mass_kg,
                length_share: car_length_m / length_m,
                length_m: car_length_m,
                ahead_m,
            }
        })
        .collect();
    (rounded(exact_mass_kg, 100.0), length_m, cars)
}

/// Nearly constant force up to the corner speed, constant power beyond.
fn traction_effort(
    ranges: &Ranges,
    mass_kg: f64,
    speed_max_mps: f64,
    random: &mut SimulatorRandom,
) -> Vec<(f64, f64)> {
    let pull_n = mass_kg * random.uniform(ranges.pull_mps2.0, ranges.pull_mps2.1);
    let power_w = mass_kg * random.uniform(ranges.power_w_per_kg.0, ranges.power_w_per_kg.1);
    let corner_mps = power_w / (0.96 * pull_n);
    let mut points =
        vec![(0.0, pull_n), (0.5 * corner_mps, 0.98 * pull_n), (corner_mps, 0.96 * pull_n)];
    for factor in [1.15, 1.3, 1.5, 1.75, 2.0, 2.4, 2.8, 3.4] {
        if factor * corner_mps < speed_max_mps {
            points.push((factor * corner_mps, power_w / (factor * corner_mps)));
        }
    }
    if corner_mps < speed_max_mps {
        points.push((speed_max_mps, power_w / speed_max_mps));
    }
    points.iter().map(|&(v, f)| (rounded(v, 0.01), rounded(f, 100.0))).collect()
}

/// `value` to the next multiple of `quantum`, free of trailing rounding noise.
pub(super) fn rounded(value: f64, quantum: f64) -> f64 {
    let per_quantum = 1.0 / quantum;
    if per_quantum >= 1.0 {
        (value * per_quantum.round()).round() / per_quantum.round()
    } else {
        quantised(value, quantum)
    }
}
