//! The simulated brakings of Xie 2019 and Jin 2020.
//!
//! A CRH3 of 536 t brakes with full cylinder pressure on the level. The position is measured
//! every 0.2 s within 0.1 m (standard deviation); every step adds process noise, uniform within
//! 0.1 m and 0.1 km/h. The papers leave out the Davis coefficients, the number of pads and the
//! sampling time; those here reproduce their stopping distances.

use dynocar_core::pipeline::braking::gear::DeclaredGear;
use dynocar_model::train::{BrakeGear, Davis, TrainModel};
use dynocar_shared::RailCondition;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::seeds::normal;

/// Time in s between two measurements.
pub const STEP_S: f64 = 0.2;
/// Observations in a window of the papers' EM.
pub const WINDOW: usize = 40;
/// Standard deviation of a measured position in m.
pub const POSITION_STD_M: f64 = 0.1;
/// Half width of the uniform process noise of the position in m.
pub const POSITION_NOISE_M: f64 = 0.1;
/// Half width of the uniform process noise of the speed in m/s.
pub const SPEED_NOISE_MPS: f64 = 0.1 * MPS_PER_KMH;
/// Full cylinder pressure in Pa.
pub const PRESSURE_PA: f64 = 410_000.0;
/// m/s in a km/h.
pub const MPS_PER_KMH: f64 = 1.0 / 3.6;

/// CRH3 as in table 1 of both papers.
pub fn train() -> TrainModel {
    let resistance = Davis { a: 0.79, b: 0.0064 * 3.6, c: 0.000_115 * 3.6 * 3.6 };
    TrainModel {
        length_m: 200.0,
        cars: 8,
        drive: None,
        brake_gear: BrakeGear {
            cylinder_diameter_mm: Some(203.0),
            disc_radius_mm: Some(297.6),
            wheel_radius_mm: Some(460.0),
            efficiency: Some(0.85),
            ratio: Some(2.55),
            friction: Some(0.28),
            pads: Some(95.0),
            friction_brake: None,
        },
        ..TrainModel::bare("CRH3", 536_000.0, resistance)
    }
}

/// Jin 2020, figure 2, as a closed form: disc friction over speed, with a notch at 180 km/h.
pub fn disc_friction(speed_mps: f64) -> f64 {
    let kmh = speed_mps / MPS_PER_KMH;
    let notch = 0.06 * (-((kmh - 180.0) / 28.0).powi(2)).exp();
    0.30331 - 0.03846 * (kmh - 175.0) / 175.0 - notch
}

/// Jin 2020, figure 9, as a closed form: braking ratio over time.
pub fn braking_ratio(time_s: f64) -> f64 {
    let turn = std::f64::consts::TAU * time_s;
    2.55 + 0.03 * (turn / 23.0).sin() + 0.015 * (turn / 9.0 + 1.0).sin()
}

/// What is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sought {
    /// Adhesion on a wet rail, where the rail carries less than the brake.
    Adhesion,
    /// Disc friction over speed, on a rail that carries any force.
    Friction,
    /// Braking ratio over time, on a rail that carries any force.
    Ratio,
}

/// A share of the declared brake force that moves at random, as the smoother's model has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DrawnShare {
    /// It drifts, and the drift comes and goes.
    Drift {
        /// Standard deviation of the drift in 1/s.
        std_per_s: f64,
        /// Time in s after which the drift is forgotten.
        time_s: f64,
    },
    /// It walks at random.
    Walk {
        /// Standard deviation that it gains in 1 s.
        std_after_1_s: f64,
    },
}

impl DrawnShare {
    /// The first drift in 1/s.
    fn first_drift(self, random: &mut ChaCha8Rng) -> f64 {
        match self {
            DrawnShare::Drift { std_per_s, .. } => std_per_s * normal(random),
            DrawnShare::Walk { .. } => 0.0,
        }
    }

    /// Share and drift a step later; `noise` is 0 for a share that stays.
    fn step(self, share: f64, drift: f64, noise: f64, random: &mut ChaCha8Rng) -> (f64, f64) {
        match self {
            DrawnShare::Drift { std_per_s, time_s } => {
                let kept = (-STEP_S / time_s).exp();
                let new = noise * std_per_s * (1.0 - kept * kept).sqrt() * normal(random);
                (share + STEP_S * drift, kept * drift + new)
            }
            DrawnShare::Walk { std_after_1_s } => {
                (share + noise * std_after_1_s * STEP_S.sqrt() * normal(random), 0.0)
            }
        }
    }
}

/// One braking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Braking {
    /// What is looked for.
    pub sought: Sought,
    /// Draws the coefficient instead of taking the papers' curve.
    pub drawn: Option<DrawnShare>,
    /// First speed in km/h.
    pub from_kmh: f64,
    /// Last speed in km/h.
    pub to_kmh: f64,
    /// Estimates count from this speed in km/h on, where the papers call them settled.
    pub scored_from_kmh: f64,
}

/// Xie 2019, table 2.
pub const XIE_TABLE_2: Braking = Braking {
    sought: Sought::Adhesion,
    drawn: None,
    from_kmh: 300.0,
    to_kmh: 100.0,
    scored_from_kmh: 270.0,
};
/// Xie 2019, table 3.
pub const XIE_TABLE_3: Braking = Braking {
    sought: Sought::Adhesion,
    drawn: None,
    from_kmh: 250.0,
    to_kmh: 50.0,
    scored_from_kmh: 220.0,
};
/// Jin 2020, table 3.
pub const JIN_TABLE_3: Braking = Braking {
    sought: Sought::Friction,
    drawn: None,
    from_kmh: 350.0,
    to_kmh: 5.0,
    scored_from_kmh: 320.0,
};
/// Jin 2020, table 4.
pub const JIN_TABLE_4: Braking = Braking {
    sought: Sought::Ratio,
    drawn: None,
    from_kmh: 350.0,
    to_kmh: 5.0,
    scored_from_kmh: 320.0,
};

/// One measured moment, with the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Time in s since the brakes came on.
    pub time_s: f64,
    /// True speed in m/s.
    pub speed_mps: f64,
    /// True position in m.
    pub position_m: f64,
    /// Measured position in m.
    pub measured_m: f64,
    /// Measured speed in m/s, used only to start with.
    pub measured_mps: f64,
    /// The true coefficient.
    pub truth: f64,
    /// True where an estimate counts: settled, and for adhesion the rail is the smaller one.
    pub is_scored: bool,
}

/// The share that a drawn coefficient starts from.
const DRAWN_SHARE: f64 = 0.8;

impl Braking {
    /// True coefficient on the papers' curve, and the share of the declared brake force that is
    /// achieved with it.
    fn on_curve(&self, time_s: f64, speed_mps: f64) -> (f64, f64) {
        let declared = declared(self.sought);
        match self.sought {
            Sought::Adhesion => {
                let adhesion = RailCondition::Wet.adhesion(speed_mps);
                (adhesion, adhesion.min(declared) / declared)
            }
            Sought::Friction => {
                let friction = disc_friction(speed_mps);
                (friction, friction / declared)
            }
            Sought::Ratio => {
                let ratio = braking_ratio(time_s);
                (ratio, ratio / declared)
            }
        }
    }

    /// Simulates one braking.
    pub fn simulate(&self, seed: u64) -> Vec<Moment> {
        self.integrate(&mut ChaCha8Rng::seed_from_u64(seed), 1.0)
    }

    /// The braking without process and measurement noise.
    pub fn nominal(&self) -> Vec<Moment> {
        self.integrate(&mut ChaCha8Rng::seed_from_u64(0), 0.0)
    }

    fn integrate(&self, random: &mut ChaCha8Rng, noise: f64) -> Vec<Moment> {
        let train = train();
        let gravity_mps2 = 1000.0 * TrainModel::weight_kn(1.0);
        let full_mps2 = declared(Sought::Adhesion) * gravity_mps2;
        let (mut time_s, mut position_m) = (0.0, 0.0);
        let mut speed_mps = self.from_kmh * MPS_PER_KMH;
        let mut share = DRAWN_SHARE;
        let mut drift = self.drawn.map_or(0.0, |drawn| noise * drawn.first_drift(random));
        let mut moments = Vec::new();
        while speed_mps > self.to_kmh * MPS_PER_KMH {
            let (truth, achieved) = match self.drawn {
                None => self.on_curve(time_s, speed_mps),
                Some(_) => (share * declared(self.sought), share),
            };
            let is_rail_limited = self.drawn.is_some()
                || self.sought != Sought::Adhesion
                || truth < declared(self.sought);
            moments.push(Moment {
                time_s,
                speed_mps,
                position_m,
                measured_m: position_m + noise * POSITION_STD_M * normal(random),
                measured_mps: speed_mps + noise * SPEED_NOISE_MPS * uniform(random),
                truth,
                is_scored: speed_mps <= self.scored_from_kmh * MPS_PER_KMH && is_rail_limited,
            });
            let resistance = 1e-3 * gravity_mps2 * train.resistance.w0_n_per_kn(speed_mps);
            let after_mps = speed_mps - STEP_S * (achieved * full_mps2 + resistance);
            position_m +=
                0.5 * STEP_S * (speed_mps + after_mps) + noise * POSITION_NOISE_M * uniform(random);
            speed_mps = after_mps + noise * SPEED_NOISE_MPS * uniform(random);
            time_s += STEP_S;
            if let Some(drawn) = self.drawn {
                (share, drift) = drawn.step(share, drift, noise, random);
            }
        }
        moments
    }
}

/// The declared value of what is looked for; of adhesion, what the declared brake would need.
pub fn declared(sought: Sought) -> f64 {
    let train = train();
    let gear = DeclaredGear::of(&train.brake_gear).expect("a declared gear");
    match sought {
        Sought::Adhesion => {
            gear.declared_force_n(PRESSURE_PA) / (1000.0 * TrainModel::weight_kn(train.mass_kg))
        }
        Sought::Friction => gear.friction,
        Sought::Ratio => gear.ratio,
    }
}

/// Uniform in -1 to 1.
pub fn uniform(random: &mut ChaCha8Rng) -> f64 {
    2.0 * random.random::<f64>() - 1.0
}
