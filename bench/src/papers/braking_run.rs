//! A pipeline over a simulated braking.

use std::sync::Arc;

use dynocar_core::pipeline::Outcome;
use dynocar_estimators::EstimatorSettings;
use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::Resistance;
use dynocar_model::train::TrainModel;
use dynocar_shared::{Parameter, ParameterSnapshot};

use super::braking::{Moment, PRESSURE_PA, STEP_S, train};

/// The sample that a pipeline sees at a moment.
pub fn resolved(train: &TrainModel, moment: &Moment, is_first: bool) -> ResolvedSample {
    ResolvedSample {
        time_ns: (moment.time_s * 1e9).round() as i64,
        step_s: if is_first { 0.0 } else { STEP_S },
        segment: 1,
        direction: 1.0,
        position_m: Some(moment.measured_m),
        speed_mps: moment.measured_mps,
        mass_kg: train.mass_kg,
        is_mass_measured: false,
        inertial_mass_kg: train.mass_kg * (1.0 + train.rotating_mass_factor),
        weight_kn: TrainModel::weight_kn(train.mass_kg),
        traction_force_n: None,
        brake_force_n: None,
        gradient_permille: Some(0.0),
        gradient_std_permille: 0.0,
        curvature_per_m: None,
        resistance: Resistance::BASIC,
        extra_n_per_kn: 0.0,
        since_cold_s: 0.0,
        tunnel_share: None,
        brake_cylinder_pressure_pa: Some(PRESSURE_PA),
        ambient_temperature_degc: None,
        is_sliding: false,
    }
}

/// An estimate and the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scored {
    /// The true coefficient.
    pub truth: f64,
    /// Estimate minus truth.
    pub error: f64,
    /// Its claimed standard deviation.
    pub std: f64,
}

/// Runs a pipeline over a braking and scores its updates once for each lag: as if an estimate
/// belonged to the moment so many steps before its update.
pub fn run<const LAGS: usize>(
    settings: &EstimatorSettings,
    moments: &[Moment],
    lags_steps: [usize; LAGS],
) -> [Vec<Scored>; LAGS] {
    let train = Arc::new(train());
    let mut estimator = settings.build(&train).expect("valid settings");
    let mut snapshot = ParameterSnapshot::empty();
    let mut scored = std::array::from_fn(|_| Vec::new());
    for (k, moment) in moments.iter().enumerate() {
        if estimator.update(&resolved(&train, moment, k == 0)) != Outcome::Updated {
            continue;
        }
        estimator.write(&mut snapshot);
        let Some((value, std)) = coefficient(&snapshot) else { continue };
        for (lag_steps, scored) in lags_steps.into_iter().zip(&mut scored) {
            let of = k.checked_sub(lag_steps).map(|i| &moments[i]);
            if let Some(of) = of.filter(|of| of.is_scored) {
                let error = value - of.truth;
                scored.push(Scored { truth: of.truth, error, std });
            }
        }
    }
    scored
}

/// The coefficient of a snapshot, be it a number or a bound.
fn coefficient(snapshot: &ParameterSnapshot) -> Option<(f64, f64)> {
    [
        Parameter::Adhesion,
        Parameter::AdhesionLowerBound,
        Parameter::DiscFriction,
        Parameter::BrakingRatio,
    ]
    .into_iter()
    .find_map(|parameter| Some((snapshot.value(parameter)?, snapshot.std(parameter)?)))
}
