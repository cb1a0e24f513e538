//! Balance of forces of a pass, second by second.
//!
//! ```text
//! control force = mass ((1 + gamma) dv/dt + g (w0(v) + k/R) / 1000 + g gradient)
//! ```
//!
//! Speeds are averaged over blocks of a second or more; the difference of two blocks is the
//! acceleration weighted by a triangle over both, and so are the forces.
//!
//! Resistance, mass, passengers and the time offset are unknown, and the same in all passes of a vehicle.

use dynocar_shared::resistance::GRAVITY_MPS2;
use nalgebra::{SMatrix, SVector};

use super::chainage::Chained;
use super::recording::RawRecording;
use crate::statistics::middle;

/// Speed in m/s below which holding brakes and stiction act.
const MOVING_MPS: f64 = 0.8;
/// Longest step in s between rows that are joined.
const STEP_MAX_S: f64 = 2.5;

/// One difference of two blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockDifference {
    /// Number of the pass.
    pub pass: u32,
    /// Place in m along the alignment.
    pub along_m: f64,
    /// Half the distance in m between the centres of the blocks, 0 for single rows.
    pub reach_m: f64,
    /// Mean speed in m/s.
    pub speed_mps: f64,
    /// Acceleration in m/s².
    pub acceleration_mps2: f64,
    /// Mean control force in N.
    pub force_n: f64,
    /// Change of the mean force in N for each second that forces are stamped too early.
    pub force_change_n: f64,
    /// Lowest, mean and greatest friction-brake pressure in Pa; 0 where none is recorded.
    pub friction_pa: [f64; 3],
    /// Declared curve resistance in N/kN.
    pub curve_n_per_kn: f64,
    /// Declared mass in kg, with counted passengers.
    pub mass_kg: f64,
    /// Number of passengers, 0 where not counted.
    pub passengers: f64,
}

/// Returns the observations of a pass with blocks of `block_s`; `speed_factor` is true over recorded speed.
pub fn observations(
    raw: &RawRecording,
    chained: &Chained,
    pass: u32,
    block_s: f64,
    speed_factor: f64,
) -> Vec<BlockDifference> {
    let rows = chained.first_row..chained.first_row + chained.chainage_m.len();
    let period_s = period(&raw.time_s[rows.clone()]);
    let block = ((block_s / period_s).round() as usize).max(1);
    let mut found = Vec::new();
    let mut from = rows.start;
    while from + 2 * block <= rows.end {
        let window = from..from + 2 * block;
        if let Some(mut observation) = observe(raw, window, block, speed_factor) {
            let along = |row: usize| chained.chainage_m[row - chained.first_row];
            let (first, last) = (along(from), along(from + 2 * block - 1));
            observation.pass = pass;
            observation.along_m = 0.5 * (first + last);
            observation.reach_m = if block == 1 { 0.0 } else { 0.25 * (last - first) };
            found.push(observation);
        }
        from += block;
    }
    found
}

fn period(time_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    middle(&mut steps).map_or(1.0, |step_s| step_s.max(1e-3))
}

/// Returns the difference of the two blocks of a window; `None` where the vehicle stands or values are
/// missing.
fn observe(
    raw: &RawRecording,
    window: std::ops::Range<usize>,
    block: usize,
    speed_factor: f64,
) -> Option<BlockDifference> {
    let friction = |row: usize| raw.friction_pa.get(row).copied().unwrap_or(0.0);
    let mut friction_pa = [f64::INFINITY, 0.0, 0.0];
    for row in window.clone() {
        // Comparisons with NaN fail, so that missing values end here too.
        if !(raw.speed_mps[row] > MOVING_MPS && raw.control_n[row].is_finite()) {
            return None;
        }
        friction_pa[0] = friction_pa[0].min(friction(row));
        friction_pa[1] += friction(row) / window.len() as f64;
        friction_pa[2] = friction_pa[2].max(friction(row));
    }
    let (mut force, mut change, mut speed, mut total_s) = (0.0, 0.0, 0.0, 0.0);
    for row in window.start..window.end - 1 {
        let step_s = raw.time_s[row + 1] - raw.time_s[row];
        if !(step_s > 0.0 && step_s <= STEP_MAX_S) {
            return None;
        }
        // The triangle: 1, 2 … block … 2, 1.
        let index = row - window.start;
        let weight = (index + 1).min(2 * block - 1 - index) as f64;
        let (one_n, other_n) = (raw.control_n[row], raw.control_n[row + 1]);
        force += weight * 0.5 * step_s * (one_n + other_n);
        change += weight * (other_n - one_n);
        speed += weight * 0.5 * step_s * (raw.speed_mps[row] + raw.speed_mps[row + 1]);
        total_s += weight * step_s;
    }
    let mean =
        |range: std::ops::Range<usize>| raw.speed_mps[range].iter().sum::<f64>() / block as f64;
    let (middle, end) = (window.start + block, window.end);
    let gained_mps = mean(middle..end) - mean(window.start..middle);
    let row = window.start + block - 1;
    if !raw.mass_kg[row].is_finite() {
        return None;
    }
    Some(BlockDifference {
        pass: 0,
        along_m: 0.0,
        reach_m: 0.0,
        speed_mps: speed_factor * speed / total_s,
        acceleration_mps2: speed_factor * gained_mps * block as f64 / total_s,
        force_n: force / total_s,
        force_change_n: change / total_s,
        friction_pa,
        curve_n_per_kn: 0.0,
        mass_kg: raw.mass_kg[row],
        passengers: raw.passengers.get(row).copied().unwrap_or(0.0),
    })
}

/// The common unknowns: a, b, c in N/kN (v in m/s), the factor on the declared mass less 1, the time in s by which
/// forces act before their time stamps, and the mass of a passenger in kg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Common(pub SVector<f64, { Common::COUNT }>);

impl Common {
    /// Number of unknowns.
    pub const COUNT: usize = 6;

    /// Davis coefficients in N/kN.
    pub fn davis(&self) -> [f64; 3] {
        [self.0[0], self.0[1], self.0[2]]
    }

    /// True over declared mass, less 1.
    pub fn mass_share(&self) -> f64 {
        self.0[3]
    }

    /// Returns the time in s by which forces act before their time stamps.
    pub fn delay_s(&self) -> f64 {
        self.0[4]
    }

    /// Returns the mass of a passenger in kg.
    pub fn passenger_kg(&self) -> f64 {
        self.0[5]
    }
}

/// Declared values of a vehicle, and their uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Declared mass in kg, without counted passengers.
    pub mass_kg: f64,
    /// Declared mass of a passenger in kg.
    pub passenger_kg: f64,
    /// Rotating-mass factor: it scales like the force and stays as declared.
    pub rotating_mass_factor: f64,
    /// Declared Davis coefficients in N/kN.
    pub davis: [f64; 3],
    /// Typical speed in m/s.
    pub speed_mps: f64,
    /// True when the recordings declare a weighed mass, rather than a nominal one.
    pub is_weighed: bool,
    /// True when passengers are counted.
    pub has_passengers: bool,
}

impl Prior {
    /// Returns the declared values.
    pub fn start(&self) -> Common {
        let [a, b, c] = self.davis;
        Common(SVector::from([a, b, c, 0.0, 0.0, self.passenger_kg]))
    }

    /// Returns the standard deviations of the unknowns before the recordings.
    ///
    /// The resistance at the typical speed is believed within half of itself and 1 N/kN, however
    /// it is shared out between a, b and c.
    fn std(&self) -> [f64; Common::COUNT] {
        let [a, b, c] = self.davis;
        let speed = self.speed_mps.max(3.0);
        let usual = (a + speed * (b + speed * c)).abs();
        let share = 0.5 * usual + 1.0;
        let passenger = if self.has_passengers { 15.0 } else { 1e-3 };
        let mass = if self.is_weighed { 0.02 } else { 0.15 };
        [share, 0.3 * share / speed, 0.7 * share / (speed * speed), mass, 0.3, passenger]
    }

    /// Normal matrix and right-hand side of the prior at a point.
    pub fn rows(
        &self,
        now: &Common,
    ) -> (SMatrix<f64, { Common::COUNT }, { Common::COUNT }>, SVector<f64, { Common::COUNT }>) {
        let weights = SVector::from(self.std().map(|std| 1.0 / (std * std)));
        let away = self.start().0 - now.0;
        (SMatrix::from_diagonal(&weights), weights.component_mul(&away))
    }

    /// Returns the force in N for each kg, without the gradient.
    pub fn unit_force(&self, observation: &BlockDifference, common: &Common) -> f64 {
        let [a, b, c] = common.davis();
        let speed = observation.speed_mps;
        (1.0 + self.rotating_mass_factor) * observation.acceleration_mps2
            + GRAVITY_MPS2 * (a + speed * (b + speed * c) + observation.curve_n_per_kn) / 1000.0
    }

    /// Returns the mass in kg at an observation.
    pub fn mass_kg(&self, observation: &BlockDifference, common: &Common) -> f64 {
        let counted = observation.passengers * (common.passenger_kg() - self.passenger_kg);
        observation.mass_kg + self.mass_kg * common.mass_share() + counted
    }

    /// Returns the change of the modelled force by each unit of the unknowns, in N.
    pub fn slopes(
        &self,
        observation: &BlockDifference,
        mass_kg: f64,
        unit: f64,
    ) -> [f64; Common::COUNT] {
        let weight_kn = mass_kg * GRAVITY_MPS2 / 1000.0;
        let speed = observation.speed_mps;
        [
            weight_kn,
            weight_kn * speed,
            weight_kn * speed * speed,
            self.mass_kg * unit,
            -observation.force_change_n,
            observation.passengers * unit,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::survey::chainage::WheelsAndLag;

    #[test]
    fn a_constant_acceleration_is_seen_whatever_the_block() {
        let count = 60;
        let time_s: Vec<f64> = (0..count).map(|row| 0.2 * f64::from(row)).collect();
        let raw = RawRecording {
            speed_mps: time_s.iter().map(|time| 5.0 + 0.3 * time).collect(),
            control_n: time_s.iter().map(|time| 1000.0 + 10.0 * time).collect(),
            mass_kg: vec![100e3; count as usize],
            time_s: time_s.clone(),
            ..RawRecording::default()
        };
        let chainage_m = time_s.iter().map(|time| 5.0 * time + 0.15 * time * time).collect();
        let chained = Chained { first_row: 0, chainage_m, learned: WheelsAndLag::UNKNOWN };
        for block_s in [0.2, 1.0, 2.0] {
            let seen = observations(&raw, &chained, 3, block_s, 1.0);
            assert!(!seen.is_empty());
            for observation in seen {
                assert!((observation.acceleration_mps2 - 0.3).abs() < 1e-9, "{block_s}");
                assert!((observation.force_change_n - 10.0).abs() < 1e-9, "{block_s}");
                // Where the mean speed is, there the mean force is: both are linear in time.
                let time_s = (observation.speed_mps - 5.0) / 0.3;
                assert!((observation.force_n - 1000.0 - 10.0 * time_s).abs() < 1e-6);
            }
        }
    }
}
