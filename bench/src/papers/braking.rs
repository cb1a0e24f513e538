//! The simulated brakings of Xie 2019 and Jin 2020.
//!
//! A CRH3 of 536 t brakes with full cylinder pressure on the level. The position is measured
//! every 0.2 s within 0.1 m (standard deviation); every step adds process noise, uniform within
//! 0.1 m and 0.1 km/h. The papers leave out the Davis coefficients, the number of pads and the
//! sampling time; those here reproduce their stopping distances.

use dynocar_core::pipeline::braking::intake::{BrakingCoefficient, DeclaredGear};
use dynocar_core::pipeline::braking::settings::WalkSettings;
use dynocar_model::train::{BrakeGear, Davis, TrainModel};
use dynocar_shared::RailCondition;
use dynocar_tests::chance::Chance;

use crate::statistics::KMH;

/// Time in s between two measurements.
pub const STEP_S: f64 = 0.2;
/// Observations in a window of the papers' EM.
pub const WINDOW: usize = 40;
/// Standard deviation of a measured position in m.
pub const POSITION_STD_M: f64 = 0.1;
/// Half width of the uniform process noise of the position in m.
pub const POSITION_NOISE_M: f64 = 0.1;
/// Half width of the uniform process noise of the speed in m/s.
pub const SPEED_NOISE_MPS: f64 = 0.1 * KMH;
/// Full cylinder pressure in Pa.
pub const PRESSURE_PA: f64 = 410_000.0;

/// CRH3 as in table 1 of both papers.
pub fn train() -> TrainModel {
    let resistance = Davis { a: 0.79, b: 0.0064 * 3.6, c: 0.000_115 * 3.6 * 3.6 };
    TrainModel {
        length_m: 200.0,
        cars: 8,
        brake_gear: BrakeGear {
            cylinder_diameter_mm: Some(203.0),
            disc_radius_mm: Some(297.6),
            wheel_radius_mm: Some(460.0),
            efficiency: Some(0.85),
            ratio: Some(2.55),
            friction: Some(0.28),
            pads: Some(95.0),
            ..BrakeGear::default()
        },
        ..TrainModel::bare("CRH3", 536_000.0, resistance)
    }
}

/// Jin 2020, figure 2, as a closed form: disc friction over speed, with a notch at 180 km/h.
pub fn disc_friction(speed_mps: f64) -> f64 {
    let kmh = speed_mps / KMH;
    let notch = 0.06 * (-((kmh - 180.0) / 28.0).powi(2)).exp();
    0.30331 - 0.03846 * (kmh - 175.0) / 175.0 - notch
}

/// Jin 2020, figure 9, as a closed form: braking ratio over time.
pub fn braking_ratio(time_s: f64) -> f64 {
    let turn = std::f64::consts::TAU * time_s;
    2.55 + 0.03 * (turn / 23.0).sin() + 0.015 * (turn / 9.0 + 1.0).sin()
}

/// How a drawn share of the declared brake force moves in a step, as the smoother's model has it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShareStep {
    /// Standard deviation that the share gains.
    pub share_std: f64,
    /// Standard deviation of the drift in 1/s at first.
    pub drift_std_per_s: f64,
    /// Share of the drift that is kept.
    pub kept: f64,
    /// Standard deviation in 1/s that the drift gains.
    pub gained_std_per_s: f64,
}

impl From<WalkSettings> for ShareStep {
    fn from(walk: WalkSettings) -> Self {
        match walk {
            WalkSettings::Drift { std_per_s, time_s } => {
                let kept = (-STEP_S / time_s).exp();
                let gained_std_per_s = std_per_s * (1.0 - kept * kept).sqrt();
                ShareStep { share_std: 0.0, drift_std_per_s: std_per_s, kept, gained_std_per_s }
            }
            WalkSettings::Scale { std_after_1_s } => {
                ShareStep { share_std: std_after_1_s * STEP_S.sqrt(), ..ShareStep::default() }
            }
        }
    }
}

/// One braking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Braking {
    /// Coefficient that is estimated.
    pub sought: BrakingCoefficient,
    /// Draws the coefficient instead of taking the papers' curve.
    pub drawn: Option<ShareStep>,
    /// First speed in km/h.
    pub from_kmh: f64,
    /// Last speed in km/h.
    pub to_kmh: f64,
    /// Estimates count from this speed in km/h on, where the papers call them settled.
    pub scored_from_kmh: f64,
}

const fn table(
    sought: BrakingCoefficient,
    [from_kmh, to_kmh, scored_from_kmh]: [f64; 3],
) -> Braking {
    Braking { sought, drawn: None, from_kmh, to_kmh, scored_from_kmh }
}

/// Xie 2019, table 2.
pub const XIE_TABLE_2: Braking = table(BrakingCoefficient::Adhesion, [300.0, 100.0, 270.0]);
/// Xie 2019, table 3.
pub const XIE_TABLE_3: Braking = table(BrakingCoefficient::Adhesion, [250.0, 50.0, 220.0]);
/// Jin 2020, table 3.
pub const JIN_TABLE_3: Braking = table(BrakingCoefficient::Friction, [350.0, 5.0, 320.0]);
/// Jin 2020, table 4.
pub const JIN_TABLE_4: Braking = table(BrakingCoefficient::Ratio, [350.0, 5.0, 320.0]);

/// One measured moment, with the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrakingMoment {
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
    /// True coefficient on the papers' curve.
    fn on_curve(&self, time_s: f64, speed_mps: f64) -> f64 {
        match self.sought {
            BrakingCoefficient::Adhesion => RailCondition::Wet.adhesion(speed_mps),
            BrakingCoefficient::Friction => disc_friction(speed_mps),
            BrakingCoefficient::Ratio => braking_ratio(time_s),
        }
    }

    /// Simulates one braking.
    pub fn simulate(&self, seed: u64) -> Vec<BrakingMoment> {
        self.integrate(&mut Chance::new(seed), 1.0)
    }

    /// Returns the braking without process and measurement noise.
    pub fn nominal(&self) -> Vec<BrakingMoment> {
        self.integrate(&mut Chance::new(0), 0.0)
    }

    fn integrate(&self, random: &mut Chance, noise: f64) -> Vec<BrakingMoment> {
        let train = train();
        let gravity_mps2 = 1000.0 * TrainModel::weight_kn(1.0);
        let full_mps2 = declared(BrakingCoefficient::Adhesion) * gravity_mps2;
        let declared = declared(self.sought);
        let (mut time_s, mut position_m) = (0.0, 0.0);
        let mut speed_mps = self.from_kmh * KMH;
        let mut share = DRAWN_SHARE;
        let drawn = self.drawn.unwrap_or_default();
        let mut drift = match drawn.drift_std_per_s > 0.0 {
            true => noise * drawn.drift_std_per_s * random.normal(),
            false => 0.0,
        };
        let mut moments = Vec::new();
        while speed_mps > self.to_kmh * KMH {
            let is_rail = self.drawn.is_none() && self.sought == BrakingCoefficient::Adhesion;
            let truth = match self.drawn {
                None => self.on_curve(time_s, speed_mps),
                Some(_) => share * declared,
            };
            let achieved = match self.drawn {
                None => truth.min(if is_rail { declared } else { f64::INFINITY }) / declared,
                Some(_) => share,
            };
            let is_rail_limited = !is_rail || truth < declared;
            moments.push(BrakingMoment {
                time_s,
                speed_mps,
                position_m,
                measured_m: position_m + noise * POSITION_STD_M * random.normal(),
                measured_mps: speed_mps + noise * SPEED_NOISE_MPS * random.either_way(),
                truth,
                is_scored: speed_mps <= self.scored_from_kmh * KMH && is_rail_limited,
            });
            let resistance = 1e-3 * gravity_mps2 * train.resistance.w0_n_per_kn(speed_mps);
            let after_mps = speed_mps - STEP_S * (achieved * full_mps2 + resistance);
            position_m += 0.5 * STEP_S * (speed_mps + after_mps)
                + noise * POSITION_NOISE_M * random.either_way();
            speed_mps = after_mps + noise * SPEED_NOISE_MPS * random.either_way();
            time_s += STEP_S;
            if self.drawn.is_some() {
                let by_chance = noise * random.normal();
                share += STEP_S * drift + drawn.share_std * by_chance;
                drift = drawn.kept * drift + drawn.gained_std_per_s * by_chance;
            }
        }
        moments
    }
}

/// Returns the declared value of the coefficient; of adhesion, the value that the declared brake force needs.
pub fn declared(sought: BrakingCoefficient) -> f64 {
    let train = train();
    let gear = DeclaredGear::from_gear(&train.brake_gear).expect("a declared gear");
    match sought {
        BrakingCoefficient::Adhesion => {
            gear.declared_force_n(PRESSURE_PA) / (1000.0 * TrainModel::weight_kn(train.mass_kg))
        }
        BrakingCoefficient::Friction => gear.friction,
        BrakingCoefficient::Ratio => gear.ratio,
    }
}

#[cfg(test)]
mod tests;
