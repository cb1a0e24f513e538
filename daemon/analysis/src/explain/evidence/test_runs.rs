//! A sample for the tests of what the runs say.

use dynocar_core::force::ResolvedSample;
use dynocar_core::terms::Resistance;
use dynocar_core::train::TrainModel;

/// A train of 100 t with gamma 0.06 that coasts on the level at 20 m/s.
pub fn coasting() -> ResolvedSample {
    ResolvedSample {
        time_ns: 0,
        step_s: 0.0,
        stretch: 1,
        direction: 1.0,
        position_m: None,
        speed_mps: 20.0,
        mass_kg: 100e3,
        inertial_mass_kg: 106e3,
        weight_kn: TrainModel::weight_kn(100e3),
        traction_force_n: Some(0.0),
        brake_force_n: Some(0.0),
        gradient_permille: Some(0.0),
        gradient_std_permille: 0.0,
        curvature_per_m: None,
        resistance: Resistance::BASIC,
        extra_n_per_kn: 0.0,
        tunnel_share: None,
        brake_cylinder_pressure_pa: None,
        ambient_temperature_degc: None,
        since_cold_s: 0.0,
        is_sliding: false,
    }
}
