//! A train, its line, and the usual mistakes in their declaration.

use dynocar_core::pipeline::train_kalman::TrainKalmanSettings;
use dynocar_model::terms::{adhesion, wind};
use dynocar_model::train::{Davis, TrainModel};
use dynocar_tests::chance::Chance;
use dynocar_tests::simulator::TrueDeviations;

use super::brake::Brake;

/// The kinds of traffic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traffic {
    /// Stops every 1.3 km, up to 72 km/h.
    Metro,
    /// Electric multiple unit, stops every 5 to 10 km, up to 140 km/h.
    Emu,
    /// A long freight train, stops every 30 km, up to 90 km/h.
    Freight,
    /// Stops every 60 km, up to 290 km/h.
    HighSpeed,
    /// Stops every 400 m, up to 43 km/h, gradients up to 60 ‰.
    Tram,
}

/// How the load is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadSource {
    /// The declared mass is the true one, and the configuration says so.
    Exact,
    /// Every sample carries a mass wrong by this many per mille, too low or too high.
    Weighed(u32),
    /// Samples carry no mass; the declared one is wrong by up to 12 %.
    Unknown,
    /// The load changes at every stop; samples carry it, each time weighed anew with 3 %.
    Changing,
    /// Samples carry no mass; tare and full load are declared, and a third of the possible load changes while the train
    /// stands.
    Passengers,
}

/// One row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scenario {
    /// The traffic.
    pub traffic: Traffic,
    /// How the load is known.
    pub load: LoadSource,
    /// True where forces jump from cycle to cycle; else their change is limited.
    pub jumps: bool,
    /// Samples per second.
    pub rate_hz: u32,
    /// Standard deviation of the measured speed in m/s; at 0 there are no gusts either.
    pub speed_noise_mps: f64,
    /// Standard deviation of the measured position in m.
    pub position_noise_m: f64,
    /// Standard deviation in ‰ of the map's gradient.
    pub map_std_permille: f64,
    /// The brake.
    pub brake: Brake,
}

/// Differences between the kinds of traffic.
pub struct Habits {
    /// Distance between stops in m, least and most.
    pub stop_m: (f64, f64),
    /// Highest speed in m/s.
    pub top_mps: f64,
    /// Greatest acceleration and deceleration in m/s².
    pub acceleration_mps2: (f64, f64),
    /// Standing time at a stop in s.
    pub standing_s: f64,
    /// Length of the line in m.
    pub line_m: f64,
    /// Steepest gradient in ‰.
    pub steep_permille: f64,
    /// Deceleration in m/s² demanded of the brake of a standing train.
    pub holding_mps2: f64,
}

impl Traffic {
    /// Returns its habits.
    pub fn habits(self) -> Habits {
        let habits =
            |stop_m, top_mps, acceleration_mps2, standing_s, line_m, steep_permille| Habits {
                stop_m,
                top_mps,
                acceleration_mps2,
                standing_s,
                line_m,
                steep_permille,
                holding_mps2: if self == Traffic::Tram { 1.2 } else { 0.3 },
            };
        match self {
            Traffic::Metro => habits((900.0, 1700.0), 20.0, (1.0, 0.9), 30.0, 16e3, 15.0),
            Traffic::Emu => habits((5e3, 10e3), 38.0, (0.6, 0.7), 60.0, 70e3, 10.0),
            Traffic::Freight => habits((25e3, 40e3), 24.0, (0.15, 0.3), 180.0, 120e3, 6.0),
            Traffic::HighSpeed => habits((50e3, 80e3), 80.0, (0.45, 0.5), 180.0, 400e3, 12.0),
            Traffic::Tram => habits((350.0, 450.0), 12.0, (1.0, 1.0), 20.0, 12e3, 60.0),
        }
    }

    /// Returns the train as declared.
    pub fn declared(self) -> TrainModel {
        let (mass_kg, length_m, [a, b, c]) = match self {
            Traffic::Metro => (230e3, 120.0, [2.1, 0.02, 0.0016]),
            Traffic::Emu => (400e3, 160.0, [1.5, 0.02, 0.0008]),
            Traffic::Freight => (1600e3, 600.0, [1.2, 0.01, 0.0010]),
            Traffic::HighSpeed => (480e3, 200.0, [0.8, 0.008, 0.000_45]),
            Traffic::Tram => (38e3, 30.0, [4.0, 0.05, 0.004]),
        };
        TrainModel {
            length_m,
            rotating_mass_factor: if self == Traffic::Tram { 0.10 } else { 0.06 },
            full_mass_kg: (self == Traffic::Tram).then_some(mass_kg + ROOM_KG),
            ..TrainModel::bare("scenario", mass_kg, Davis { a, b, c })
        }
    }
}

/// Passengers that a tram has room for, in kg, and the standard deviation of how many change at a stop.
pub const ROOM_KG: f64 = 12e3;
/// See [`ROOM_KG`].
pub const BOARDING_STD_KG: f64 = 4e3;

/// Standard deviation of a weighing as a share of the mass, where the load changes.
pub const WEIGHING_STD: f64 = 0.03;
/// Distance in m between the knots of the map's error.
pub const KNOT_M: f64 = 200.0;
/// Time in s between the knots of the gusts.
pub const GUST_S: f64 = 20.0;
/// Standard deviation at the knots of straight lines whose standard deviation along the line is 1.
pub const KNOT_OVER_MEAN: f64 = 1.22;

/// Returns the standard deviation in ‰ of the map's error at a knot where it is that much on the average: straight
/// lines between knots vary less.
pub fn knot_std_permille(map_std_permille: f64) -> f64 {
    KNOT_OVER_MEAN * map_std_permille
}

/// A seeded draw of a scenario.
pub struct World {
    /// The scenario.
    pub scenario: Scenario,
    /// Sizes of the mistakes behind the draw.
    pub mistakes: Mistakes,
    /// As declared.
    pub declared: TrainModel,
    /// The true train; its mass is that of the first load.
    pub truth: TrainModel,
    /// Traction and brake force as reported over the true ones.
    pub force_scale: [f64; 2],
    /// Exerted brake force over the assumed one.
    pub brake_scale: f64,
    /// Wind of the day in m/s along the growing chainage.
    pub wind_mps: f64,
    /// Measured speed over the true one.
    pub speed_scale: f64,
    /// How much later in s than reported forces act.
    pub delay_s: f64,
    /// Gradient in ‰ of the map and the true one, mean under the train, by piece of `PIECE_M`.
    gradient: Vec<[f64; 2]>,
    /// Where the train stops.
    pub stops_m: Vec<f64>,
    /// For the drive.
    pub random: Chance,
}

/// Length in m of a piece of the gradient profile.
const PIECE_M: f64 = 10.0;

impl World {
    /// Draws the truth.
    pub fn draw(scenario: Scenario, mut mistakes: Mistakes, seed: u64) -> Self {
        let mut random = Chance::new(seed);
        let declared = scenario.traffic.declared();
        let habits = scenario.traffic.habits();
        let mut truth = declared.clone();
        let mut near = |value: f64, share: f64| value * (1.0 + share * random.normal());
        truth.resistance = Davis {
            a: near(declared.resistance.a, mistakes.coefficient_share).max(0.3),
            b: near(declared.resistance.b, mistakes.coefficient_share).max(0.0),
            c: near(declared.resistance.c, mistakes.coefficient_share).max(1e-5),
        };
        let force_scale = [near(1.0, mistakes.force_share), near(1.0, mistakes.force_share)];
        let speed_scale = near(1.0, mistakes.wheel_share);
        let delay_s = (mistakes.mean_delay_s + near(1.0, mistakes.delay_s) - 1.0).abs();
        truth.rotating_mass_factor += near(1.0, mistakes.rotating_mass) - 1.0;
        truth.mass_kg *= match scenario.load {
            LoadSource::Exact | LoadSource::Weighed(_) => 1.0 + 0.3 * (random.uniform() - 0.5),
            LoadSource::Unknown | LoadSource::Changing => 1.0 + 0.24 * (random.uniform() - 0.5),
            LoadSource::Passengers => 1.0 + random.uniform() * ROOM_KG / declared.mass_kg,
        };
        let mut stops_m = vec![500.0];
        while stops_m[stops_m.len() - 1] < habits.line_m {
            let (least, most) = habits.stop_m;
            let last = stops_m[stops_m.len() - 1];
            stops_m.push(last + least + (most - least) * random.uniform());
        }
        let end_m = stops_m[stops_m.len() - 1] + 1000.0;
        let gradient = profile(&scenario, &habits, declared.length_m, end_m, &mut random);
        let brake_scale = 1.0 + mistakes.brake_share * random.normal();
        let wind_mps = mistakes.wind_mps * random.normal();
        if scenario.speed_noise_mps == 0.0 {
            mistakes.gust_mps = 0.0;
        }
        World {
            scenario,
            mistakes,
            declared,
            truth,
            force_scale,
            brake_scale,
            wind_mps,
            speed_scale,
            delay_s,
            gradient,
            stops_m,
            random,
        }
    }

    /// Returns the stop after one, and the direction there: at either end of the line the train turns.
    pub fn after_stop(&self, stop: usize, direction: f64) -> (usize, f64) {
        let direction = match stop {
            0 if direction < 0.0 => 1.0,
            last if direction > 0.0 && last == self.stops_m.len() - 1 => -1.0,
            _ => direction,
        };
        ((stop as f64 + direction) as usize, direction)
    }

    /// Returns the gradient in ‰ along growing chainage by the map and in truth, under a train whose centre is here.
    pub fn gradient_permille(&self, centre_m: f64) -> [f64; 2] {
        let place = (centre_m / PIECE_M).clamp(0.0, (self.gradient.len() - 2) as f64);
        let (index, share) = (place as usize, place.fract());
        let (from, to) = (self.gradient[index], self.gradient[index + 1]);
        [0, 1].map(|which| from[which] + share * (to[which] - from[which]))
    }
}

/// Gradients of the map and in truth, averaged under the train.
fn profile(
    scenario: &Scenario,
    habits: &Habits,
    train_length_m: f64,
    end_m: f64,
    random: &mut Chance,
) -> Vec<[f64; 2]> {
    let pieces = (end_m / PIECE_M) as usize + 2;
    let (mut map, mut error) = (Vec::with_capacity(pieces), Vec::with_capacity(pieces));
    let mut steep = 0.0;
    let mut left_m = 0.0;
    let (mut from, mut to) = (random.normal(), random.normal());
    for piece in 0..pieces {
        if left_m <= 0.0 {
            left_m = 300.0 + 900.0 * random.uniform();
            steep = 0.5 * habits.steep_permille * random.normal().clamp(-2.0, 2.0);
        }
        left_m -= PIECE_M;
        map.push(steep);
        let at = (piece as f64 * PIECE_M / KNOT_M).fract();
        if piece > 0 && at < PIECE_M / KNOT_M - 1e-9 {
            (from, to) = (to, random.normal());
        }
        error.push(knot_std_permille(scenario.map_std_permille) * (from + at * (to - from)));
    }
    let half = (0.5 * train_length_m / PIECE_M) as usize;
    let mean = |values: &[f64], at: usize| {
        let range = at.saturating_sub(half)..(at + half + 1).min(values.len());
        values[range.clone()].iter().sum::<f64>() / range.len() as f64
    };
    (0..pieces).map(|at| (mean(&map, at), mean(&error, at))).map(|(m, e)| [m, m + e]).collect()
}

/// Standard deviations of the ordinary mistakes, all at once; none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mistakes {
    /// Of a, b, c as a share of the declaration.
    pub coefficient_share: f64,
    /// Of the traction and the brake force as reported, as a share.
    pub force_share: f64,
    /// Of the brake's force from train to train, as a share.
    pub brake_share: f64,
    /// Of the brake's force from stop to stop, as a share.
    pub stop_to_stop_share: f64,
    /// Of the delay of forces in s, and its mean; later than reported, never before.
    pub delay_s: f64,
    /// See `delay_s`.
    pub mean_delay_s: f64,
    /// Of the wheel diameter as a share.
    pub wheel_share: f64,
    /// Of the rotating mass as a share of the mass.
    pub rotating_mass: f64,
    /// Of the wind of the day along the line in m/s.
    pub wind_mps: f64,
    /// Of its gusts in m/s.
    pub gust_mps: f64,
}

impl Mistakes {
    /// Those of careful declarations.
    pub const USUAL: Mistakes = Mistakes {
        coefficient_share: 0.3,
        force_share: TrueDeviations::ROUGH.force_share,
        brake_share: 0.02,
        stop_to_stop_share: 0.015,
        delay_s: 0.05,
        mean_delay_s: 0.1,
        wheel_share: TrueDeviations::ROUGH.wheel_share,
        rotating_mass: 0.002,
        wind_mps: TrueDeviations::ROUGH.day_wind_mps,
        gust_mps: TrueDeviations::ROUGH.gust_mps,
    };

    /// Returns the mistakes that the estimator's default settings assume.
    pub fn expected() -> Mistakes {
        let settings = TrainKalmanSettings::default();
        Mistakes {
            coefficient_share: settings.prior_relative_std,
            force_share: settings.force_scale_std,
            brake_share: adhesion::DECLARED_BRAKE_STD,
            delay_s: settings.force_delay_std_s,
            mean_delay_s: 0.0,
            wind_mps: settings.wind_std_mps,
            gust_mps: wind::GUST_SHARE * settings.wind_std_mps,
            ..Mistakes::USUAL
        }
    }
}
