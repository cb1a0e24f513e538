//! The leg on which masses are learned, and the estimators that learn them.

use dynocar_core::pipeline::mass::line_resistance::LineResistance;
use dynocar_core::pipeline::mass::{
    MassKalman, MassKalmanSettings, MassRegression, StagedDescent, StagedDescentSettings,
};

use super::line::{CURVE_RADIUS_M, STATIONS_M};
use super::shuttle::{Disturbance, EMPTY_MASS_KG, Instant, PERIOD_S, Shuttle};

/// The leg of 3 km from the first station: power, coasting around 80 km/h, braking.
pub fn leg(shuttle: &Shuttle, mass_kg: f64, disturbance: &mut dyn Disturbance) -> Vec<Instant> {
    shuttle.drive(&shuttle.standing_at(STATIONS_M[0], mass_kg), STATIONS_M[1], 10.0, disturbance)
}

/// The empty train comes to the first station, a load changes it, and it runs the leg.
///
/// On the way there the filter learns the noise of the speed; the mass of the leg it has to
/// learn anew.
pub fn there_and_back(
    shuttle: &Shuttle,
    mass_kg: f64,
    disturbance: &mut dyn Disturbance,
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
