//! Brakes of real trains: electric above a speed, friction below. The friction force follows its report late and is
//! larger or smaller than reported.

use std::ops::Range;

use dynocar_model::simulate::motion::lagged_explicitly;

/// Report of the brake by the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BrakeReport {
    /// The force demanded of electric and friction brake.
    Force,
    /// The driver's demand, before any limit of jerk.
    Demand,
    /// The demanded force, and the pressure that is in the cylinders.
    Pressure,
    /// The electric force alone.
    ElectricForce,
}

/// A brake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brake {
    /// Time constant in s with which friction follows its demand.
    pub lag_s: f64,
    /// Friction force over its demand.
    pub strength: f64,
    /// Speeds in m/s between which friction takes over; infinite where it brakes alone.
    pub hand_over_mps: (f64, f64),
    /// Its report.
    pub reported: BrakeReport,
    /// Greatest change of acceleration in m/s³.
    pub jerk_mps3: f64,
}

impl Brake {
    /// Friction never acts: the force is the demand, but for the mistakes of every train.
    pub const AS_TOLD: Brake = Brake {
        lag_s: 0.0,
        strength: 1.0,
        hand_over_mps: (0.0, 0.0),
        reported: BrakeReport::Force,
        jerk_mps3: 0.6,
    };

    /// Electric down to 3 m/s, friction from 1 m/s on.
    const BLENDED: Brake = Brake { hand_over_mps: (1.0, 3.0), jerk_mps3: 1.4, ..Brake::AS_TOLD };
    const ALONE: (f64, f64) = (f64::INFINITY, f64::INFINITY);

    /// Returns the rows of brakes with their names.
    pub fn rows() -> [(&'static str, Brake); 15] {
        let blended = |lag_s, strength| Brake { lag_s, strength, ..Brake::BLENDED };
        let alone =
            |lag_s, strength| Brake { hand_over_mps: Brake::ALONE, ..blended(lag_s, strength) };
        let told = |reported, brake: Brake| Brake { reported, ..brake };
        [
            ("blended, lag 0.1 s", blended(0.1, 1.0)),
            ("blended, lag 0.25 s", blended(0.25, 1.0)),
            ("blended, lag 0.5 s", blended(0.5, 1.0)),
            ("blended, lag 1.5 s", blended(1.5, 1.0)),
            ("blended, weak", blended(0.06, 0.88)),
            ("blended, late and weak", blended(0.25, 0.88)),
            ("friction, lag 0.25 s", alone(0.25, 1.0)),
            ("friction, lag 1.5 s", alone(1.5, 1.0)),
            ("friction, weak", alone(0.1, 0.88)),
            ("friction, strong", alone(0.1, 1.1)),
            ("friction, late and weak", alone(0.5, 0.88)),
            ("as demand", told(BrakeReport::Demand, blended(0.25, 1.0))),
            ("with pressure", told(BrakeReport::Pressure, alone(0.5, 0.88))),
            ("electric force alone", told(BrakeReport::ElectricForce, blended(0.25, 1.0))),
            ("jerk 0.4 m/s³", Brake { jerk_mps3: 0.4, ..blended(0.25, 1.0) }),
        ]
    }

    fn friction_share(&self, speed_mps: f64) -> f64 {
        let Range { start, end } = self.hand_over_mps.0..self.hand_over_mps.1;
        if start.is_infinite() {
            1.0
        } else if end > start {
            ((end - speed_mps) / (end - start)).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }
}

/// Pressure in Pa of a cylinder for each m/s² of deceleration.
const PRESSURE_PA_PER_MPS2: f64 = 3e5;

/// Friction force that acts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Friction {
    /// Deceleration in m/s² by the pressure in the cylinders.
    by_pressure_mps2: f64,
}

impl Friction {
    /// Returns the acceleration in m/s² of the demand, after a step in s at a speed in m/s.
    pub fn acts_mps2(&mut self, brake: &Brake, told_mps2: f64, speed_mps: f64, step_s: f64) -> f64 {
        let braked_mps2 = (-told_mps2).max(0.0);
        let share = brake.friction_share(speed_mps);
        self.by_pressure_mps2 =
            lagged_explicitly(self.by_pressure_mps2, share * braked_mps2, step_s, brake.lag_s);
        told_mps2.max(0.0) - (1.0 - share) * braked_mps2 - brake.strength * self.by_pressure_mps2
    }

    /// Pressure in the cylinders in Pa.
    pub fn pressure_pa(&self) -> f64 {
        PRESSURE_PA_PER_MPS2 * self.by_pressure_mps2
    }

    /// Returns the share of the force that is electric at a speed in m/s.
    pub fn electric_share(brake: &Brake, speed_mps: f64) -> f64 {
        1.0 - brake.friction_share(speed_mps)
    }
}
