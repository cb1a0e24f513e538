//! The rides: crossings of the line, the leg on which masses are learned, and the estimators that
//! learn them.

use dynocar_estimators::wang::line_resistance::LineResistance;
use dynocar_estimators::wang::{MassKalman, MassKalmanSettings};
use dynocar_estimators::wang::{MassRegression, StagedDescent, StagedDescentSettings};

use super::driver::{Driver, limit_driver};
use super::line::{CURVE_RADIUS_M, STATIONS_M};
use super::shuttle::{Disturbance, EMPTY_MASS_KG, Instant, PERIOD_S, Shuttle};

const FORCE_SLEW_N_PER_S: f64 = 80_000.0;

impl Shuttle {
    /// Drives like [`LimitDriver`].
    pub fn drive(
        &self,
        start: &Instant,
        to_m: f64,
        dwell_s: f64,
        disturbance: &mut Disturbance<'_>,
    ) -> Vec<Instant> {
        self.drive_with(&mut limit_driver(), start, to_m, dwell_s, disturbance)
    }

    /// Drives from standstill to standstill at `to_m`, then stands for `dwell_s`.
    pub fn drive_with(
        &self,
        driver: &mut Driver<'_>,
        start: &Instant,
        to_m: f64,
        dwell_s: f64,
        disturbance: &mut Disturbance<'_>,
    ) -> Vec<Instant> {
        let mut now = Instant { speed_mps: 0.0, force_n: 0.0, ..*start };
        now.direction = (to_m - now.position_m).signum();
        let mut ride = vec![now];
        loop {
            let wanted_n = driver(self, &now, to_m);
            let change = FORCE_SLEW_N_PER_S * PERIOD_S;
            let to_n = wanted_n.clamp(now.force_n - change, now.force_n + change);
            let next = self.advance(&now, to_n, disturbance);
            if next.speed_mps <= 0.0 && now.force_n < 0.0 {
                break;
            }
            now = next;
            ride.push(now);
        }
        let standing = (dwell_s / PERIOD_S).round() as usize;
        for _ in 0..standing {
            now.time_s += PERIOD_S;
            (now.speed_mps, now.force_n) = (0.0, -20_000.0);
            ride.push(now);
        }
        ride
    }

    /// Drives to and fro until there are `count` samples, the empty train throughout.
    pub fn crossing(&self, count: usize, disturbance: &mut Disturbance<'_>) -> Vec<Instant> {
        let mut ride: Vec<Instant> = Vec::with_capacity(count + 8_000);
        let mut now = self.standing_at(STATIONS_M[0], EMPTY_MASS_KG);
        let mut station = 0_usize;
        let mut is_outbound = true;
        while ride.len() < count {
            station = if is_outbound { station + 1 } else { station - 1 };
            let leg = self.drive(&now, STATIONS_M[station], 30.0, disturbance);
            now = leg[leg.len() - 1];
            now.time_s += PERIOD_S;
            ride.extend(leg);
            is_outbound = match station {
                0 => true,
                3 => false,
                _ => is_outbound,
            };
        }
        ride.truncate(count);
        ride
    }
}

/// The leg of 3 km from the first station: power, coasting around 80 km/h, braking.
pub fn leg(shuttle: &Shuttle, mass_kg: f64, disturbance: &mut Disturbance<'_>) -> Vec<Instant> {
    shuttle.drive(&shuttle.standing_at(STATIONS_M[0], mass_kg), STATIONS_M[1], 10.0, disturbance)
}

/// The empty train comes to the first station, a load changes it, and it runs the leg.
///
/// On the way there the filter learns the noise of the speed; the mass of the leg it has to
/// learn anew.
pub fn there_and_back(
    shuttle: &Shuttle,
    mass_kg: f64,
    disturbance: &mut Disturbance<'_>,
) -> Vec<Instant> {
    let empty = shuttle.standing_at(STATIONS_M[1], EMPTY_MASS_KG);
    let mut ride = shuttle.drive(&empty, STATIONS_M[0], 20.0, disturbance);
    let last = ride[ride.len() - 1];
    let loaded = Instant { time_s: last.time_s + PERIOD_S, mass_kg, ..last };
    ride.extend(shuttle.drive(&loaded, STATIONS_M[1], 10.0, disturbance));
    ride
}

/// The resistances that act.
pub fn known_resistance(shuttle: &Shuttle) -> LineResistance {
    LineResistance {
        basic: shuttle.truth.basic,
        curve: Some(shuttle.truth.curve),
        tunnel: Some(shuttle.truth.tunnel),
        reference_radius_m: CURVE_RADIUS_M,
    }
}

/// Our filter with a resistance.
pub fn kalman(shuttle: &Shuttle, resistance: &LineResistance) -> MassKalman {
    let settings = MassKalmanSettings::default().with_resistance(resistance);
    MassKalman::new(settings, &shuttle.train).expect("default settings")
}

/// The paper's last stage with a resistance.
pub fn staged(
    shuttle: &Shuttle,
    mass_regression: MassRegression,
    resistance: &LineResistance,
) -> StagedDescent {
    let settings = StagedDescentSettings { mass_regression, ..StagedDescentSettings::default() };
    let mut staged = StagedDescent::new(settings, &shuttle.train).expect("default settings");
    staged.resume(resistance);
    staged
}
