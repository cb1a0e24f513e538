//! Braking distance and time: the law of `dynocar_shared::stopping`, with the arguments of the C interface.

use dynocar_client::ffi::StopRequest;
use dynocar_shared::stopping::EffortPoint;
use pyo3::prelude::*;

use crate::calls::of_code;

/// Returns distance, time, and both with the confidence. `numbers` are the members of `dynocar_stop` in `dynocar.h`
/// before `rail`.
#[pyfunction]
pub(crate) fn stopping_estimate(
    py: Python<'_>,
    numbers: [f64; 18],
    rail: u64,
    effort: Vec<(f64, f64)>,
    confidence: f64,
) -> PyResult<(f64, f64, f64, f64)> {
    let [
        from_speed_mps,
        to_speed_mps,
        mass_kg,
        rotating_mass_factor,
        gradient_permille,
        davis_a,
        davis_b,
        davis_c,
        w0_std_n_per_kn,
        brake_scale,
        brake_scale_std,
        traction_cut_off_s,
        dead_time_s,
        build_up_s,
        jerk_limit_mps3,
        response_std_s,
        adhesion,
        adhesion_std,
    ] = numbers;
    let request = StopRequest {
        from_speed_mps,
        to_speed_mps,
        mass_kg,
        rotating_mass_factor,
        gradient_permille,
        davis_a,
        davis_b,
        davis_c,
        w0_std_n_per_kn,
        brake_scale,
        brake_scale_std,
        traction_cut_off_s,
        dead_time_s,
        build_up_s,
        jerk_limit_mps3,
        response_std_s,
        adhesion,
        adhesion_std,
        rail,
    };
    let effort: Vec<EffortPoint> =
        effort.into_iter().map(|(speed_mps, force_n)| EffortPoint { speed_mps, force_n }).collect();
    let found = request.estimate(&effort, confidence).map_err(|code| of_code(py, code))?;
    Ok((found.distance_m, found.time_s, found.distance_bound_m, found.time_bound_s))
}
